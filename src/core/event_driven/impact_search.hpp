// The next impact of one ball, with any of those near it or with a wall.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "ball_sim/time_of_impact.hpp"
#include "ball_sim/vector.hpp"
#include "ball_sim/walls.hpp"
#include "event_driven/flights.hpp"
#include "event_driven/neighbourhood.hpp"
#include "event_driven/pair_search.hpp"
#include "event_driven/periodic_space.hpp"

namespace ball_sim::core {

/// The ball that another has parted from at this instant.
template <class Real>
struct JustMet {
  Slot partner = kNoSlot;
  VectorOf<Real> normal = VectorOf<Real>::Zero();  ///< unit, towards it
};

/// An impact to come.
template <class Real>
struct NextImpact {
  Real time = kNever<Real>;   ///< s, in this year
  std::uint32_t partner = 0;  ///< as in an agenda
};

template <class Real, bool kGravity>
class ImpactSearch {
  using Vec = VectorOf<Real>;
  using Next = NextImpact<Real>;
  using Met = JustMet<Real>;

 public:
  /// @param flights, space, walls  outlive the search
  ImpactSearch(const Flights<Real, kGravity>& flights, const PeriodicSpace<Real>& space,
               const std::vector<Wall<Real>>& walls)
      : flights_(flights), space_(space), walls_(walls) {
    for (std::uint32_t k = 0; k < walls.size(); ++k) {
      const Partner partner = walls[k].partner;
      if (kGravity || partner <= planePartner(0)) {
        others_.push_back(k);
        continue;
      }
      const auto face = static_cast<std::size_t>(-1 - partner);
      const Real direction = face % 2 == 0 ? -1 : 1;
      faces_[face] = {-direction * walls[k].offset, direction, kWall + k};
    }
  }

  /// Chooses the instructions to search with.
  /// @param wraps  whether nearest images are to be taken, and are all that there are
  void choose(bool wraps, std::size_t most_lanes) {
    search_pairs_ = choosePairSearch<Real>(wraps, kGravity, most_lanes);
  }

  /// Takes the earliest impact with any of these balls, if it is earlier than `next`. The ball
  /// itself may be among them: it never approaches itself.
  /// @param met  whom it has just parted from
  void considerBalls(Slot slot, const Met& met, const Near& near, Next& next) const {
    const Search search{slot,
                        met,
                        {flights_.position(slot), flights_.velocity(slot),
                         flights_.bodies[slot].radius, flights_.now}};
    if (space_.nearestSuffices()) return considerNearest(search, near, next);
    space_.forEachImage([&](const Vec& image) {
      Search shifted = search;
      shifted.seeker.x -= image;
      considerNearest(shifted, near, next);
    });
  }

  /// The same with all walls. What is found holds for the whole flight: crossings change nothing.
  void considerWalls(Slot slot, Next& next) const {
    if (walls_.empty() || flights_.isFixed(slot)) return;
    if constexpr (!kGravity) considerFaces(slot, next);
    for (const std::uint32_t wall : others_) considerWall(slot, wall, next);
  }

 private:
  // A face of the box. Where there is none, it is infinitely far.
  struct Face {
    Real place;             // m, along its axis
    Real direction;         // out of the box: -1 or +1
    std::uint32_t partner;  // as in an agenda
  };

  static std::array<Face, 6> noFaces() {
    std::array<Face, 6> faces;
    for (std::size_t i = 0; i < faces.size(); ++i) {
      const Real direction = i % 2 == 0 ? -1 : 1;
      faces[i] = {direction * kNever<Real>, direction, kWall};
    }
    return faces;
  }

  struct Search {
    Slot slot;
    const Met& met;
    Seeker<Real> seeker;
  };

  void considerNearest(const Search& search, const Near& near, Next& next) const {
    if (kGravity && !allFallFreely(search.slot, near)) return considerEach(search, near, next);
    const PairHit<Real> hit = search_pairs_(flights_.bodies.data(), near.slots, near.count,
                                            search.seeker, space_.pairs());
    const Real time = flights_.now + hit.wait;
    const Slot other = near.slots[hit.index];
    const bool earlier = time < next.time;
    const bool as_early = (time == next.time) & (hit.wait < kNever<Real>);
    const bool met = (other == search.met.partner) & earlier;
    if (as_early | hit.tied | met) {  // seldom, and then not so simple
      considerEach(search, near, next);
      return;
    }
    // Not by branches, which would often be foretold wrongly.
    next.time = std::min(next.time, time);
    next.partner = earlier ? other : next.partner;
  }

  bool allFallFreely(Slot slot, const Near& near) const {
    const auto falls = [this](Slot s) { return flights_.contacts.fallsFreely(s); };
    return falls(slot) && std::all_of(near.slots, near.slots + near.count, falls);
  }

  // The same, one by one: also where balls fall differently, or were just met, or tie.
  void considerEach(const Search& search, const Near& near, Next& next) const {
    const Seeker<Real>& seeker = search.seeker;
    for (std::size_t i = 0; i < near.count; ++i) {
      const Slot other = near.slots[i];
      Vec dx = flights_.position(other) - seeker.x;
      if (space_.nearestSuffices()) dx = space_.nearestImage(dx);
      const Vec dv = flights_.velocity(other) - seeker.v;
      const Vec da = flights_.acceleration(other) - flights_.acceleration(search.slot);
      const Real reach = flights_.bodies[other].radius + seeker.radius;
      if (dot(da, da) > 0) {
        takeIfEarlier(other, timeOfImpactAccelerated<Real>(dx, dv, da, reach), next);
      } else if (!justParted(search, other)) {
        takeIfEarlier(other, timeOfImpact<Real>(dx, dv, reach), next);
      }
    }
  }

  // In straight relative motion two balls that have just met do not meet again. In a small periodic
  // box another image of the partner may be in reach too, but not in the same direction.
  bool justParted(const Search& search, Slot other) const {
    if (other != search.met.partner) return false;
    if (space_.nearestSuffices()) return true;
    const Vec dx = flights_.position(other) - search.seeker.x;
    const Real reach = flights_.bodies[other].radius + search.seeker.radius;
    return dot(dx, search.met.normal) > Real(0.9) * reach;
  }

  void takeIfEarlier(Slot other, Real wait, Next& next) const {
    const Real time = flights_.now + wait;
    if (time < next.time || (time == next.time && isEarlierTie(other, next))) next = {time, other};
  }

  bool isEarlierTie(Slot other, const Next& next) const {
    return next.time < kNever<Real> && next.partner < kWall &&
           flights_.agendas[other].id < flights_.agendas[next.partner].id;
  }

  // The faces ahead, for a ball in straight flight. Without branches: which one comes first cannot
  // be foretold. The arithmetic is that of timeToWall().
  void considerFaces(Slot slot, Next& next) const {
    const Vec x = flights_.position(slot);
    const Vec& v = flights_.bodies[slot].v;
    const Real radius = flights_.bodies[slot].radius;
    std::array<Real, 3> times;
    std::array<std::uint32_t, 3> partners;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto k = static_cast<Eigen::Index>(axis);
      const Face& face = faces_[2 * axis + (v[k] < 0 ? 0 : 1)];
      const Real gap = (face.place - x[k]) * face.direction - radius;
      const Real wait = std::max(gap, Real(0)) / std::abs(v[k]);
      times[axis] = flights_.now + std::min(kNever<Real>, wait);  // 0/0: never
      partners[axis] = face.partner;
    }
    const Real sooner = std::min(times[0], times[1]);
    const unsigned second = times[1] < times[0] ? 1 : 0;
    const unsigned third = times[2] < sooner ? 1 : 0;
    const Real first = std::min(sooner, times[2]);
    const std::uint32_t partner = partners[2 * third + (second & ~third)];
    next.partner = first < next.time ? partner : next.partner;
    next.time = std::min(next.time, first);
  }

  void considerWall(Slot slot, std::uint32_t index, Next& next) const {
    const Wall<Real>& wall = walls_[index];
    if constexpr (kGravity) {
      if (flights_.contacts.isRestingOn(slot, static_cast<int>(index))) return;
    }
    const Real pull = dot(flights_.acceleration(slot), wall.normal);
    const Real gap =
        dot(flights_.position(slot), wall.normal) - wall.offset - flights_.bodies[slot].radius;
    const Real speed = dot(flights_.velocity(slot), wall.normal);
    const Real time = flights_.now + timeToWall<Real>(gap, speed, pull);
    if (time < next.time) next = {time, kWall + index};
  }

  const Flights<Real, kGravity>& flights_;
  const PeriodicSpace<Real>& space_;
  const std::vector<Wall<Real>>& walls_;
  std::array<Face, 6> faces_ = noFaces();  // in straight flight; by axis, the lower ones first
  std::vector<std::uint32_t> others_;      // indices into walls_ of those that are not in faces_
  PairSearch<Real> search_pairs_ = nullptr;
};

}  // namespace ball_sim::core
