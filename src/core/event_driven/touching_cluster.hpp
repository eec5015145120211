// The balls and walls that touch each other at one instant, for policy `simultaneous`
// (simultaneous_impacts.hpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "ball_sim/collapse_guard.hpp"
#include "ball_sim/simultaneous_impacts.hpp"
#include "ball_sim/vector.hpp"
#include "ball_sim/walls.hpp"
#include "event_driven/flights.hpp"
#include "event_driven/neighbourhood.hpp"
#include "event_driven/periodic_space.hpp"

namespace ball_sim::core {

/// Balls that touch each other, or through others.
template <class Real>
struct TouchingCluster {
  std::vector<Slot> members;  ///< by ascending id
  std::vector<ClusterBody<Real>> bodies;
  std::vector<ClusterContact<Real>> contacts;  ///< by bodies

  /// @return members.size() for a ball that is none
  std::size_t indexOf(Slot slot) const {
    return static_cast<std::size_t>(std::find(members.begin(), members.end(), slot) -
                                    members.begin());
  }
};

template <class Real, bool kGravity>
class TouchSearch {
  using Vec = VectorOf<Real>;
  using Cluster = TouchingCluster<Real>;

 public:
  TouchSearch(const Flights<Real, kGravity>& flights, const PeriodicSpace<Real>& space,
              const std::vector<Wall<Real>>& walls, Neighbourhood<Real>& neighbourhood)
      : flights_(flights), space_(space), walls_(walls), neighbourhood_(neighbourhood) {}

  /// @param other  a ball that it meets, or kNoSlot
  Cluster clusterAround(Slot slot, Slot other) {
    Cluster cluster;
    std::vector<Slot>& members = cluster.members;
    members.push_back(slot);
    if (other != kNoSlot) members.push_back(other);
    for (std::size_t k = 0; k < members.size(); ++k) {
      if (flights_.isFixed(members[k])) continue;  // hands nothing on
      forEachTouching(members[k], [&](Slot touched, const Vec&, Real) {
        if (cluster.indexOf(touched) == members.size()) members.push_back(touched);
      });
    }
    std::sort(members.begin(), members.end(),
              [&](Slot a, Slot b) { return flights_.agendas[a].id < flights_.agendas[b].id; });
    for (const Slot member : members) {
      cluster.bodies.push_back({flights_.velocity(member), flights_.inverseMass(member)});
    }
    for (std::size_t i = 0; i < members.size(); ++i) addContacts(cluster, i);
    return cluster;
  }

 private:
  // Calls f with each ball that `slot` touches now, the way to it, and the gap.
  template <class Function>
  void forEachTouching(Slot slot, Function f) {
    using std::sqrt;
    const Near near = neighbourhood_.near(slot, flights_.agendas[slot]);
    for (std::size_t i = 0; i < near.count; ++i) {
      const Slot other = near.slots[i];
      if (other == slot) continue;
      const Vec nearest = space_.nearestImage(flights_.position(other) - flights_.position(slot));
      const Real reach = flights_.bodies[slot].radius + flights_.bodies[other].radius;
      const Real extent = std::max(extentOf(slot), extentOf(other));
      space_.forEachImage([&](const Vec& image) {
        const Vec dx = nearest + image;
        const Real gap = sqrt(dot(dx, dx)) - reach;
        if (touches(gap, reach, extent)) f(other, dx, gap);
      });
    }
  }

  // What a ball's place was last computed from: where it is, and how far it may have come.
  Real extentOf(Slot slot) const {
    const Vec v = flights_.velocity(slot);
    return flights_.position(slot).cwiseAbs().maxCoeff() + std::sqrt(dot(v, v)) * flights_.now;
  }

  // Those of member i with walls, and with members after it.
  void addContacts(Cluster& cluster, std::size_t i) {
    const Slot slot = cluster.members[i];
    const Real radius = flights_.bodies[slot].radius;
    for (std::size_t k = 0; k < walls_.size() && !flights_.isFixed(slot); ++k) {
      const Real gap = dot(flights_.position(slot), walls_[k].normal) - walls_[k].offset - radius;
      if (!touches(gap, radius, extentOf(slot))) continue;
      ClusterContact<Real> contact;
      contact.a = i;
      contact.wall = k;
      contact.normal = -walls_[k].normal;
      contact.gap = gap;
      contact.reach = radius;
      cluster.contacts.push_back(contact);
    }
    forEachTouching(slot, [&](Slot other, const Vec& dx, Real gap) {
      const std::size_t j = cluster.indexOf(other);
      if (j <= i || j == cluster.members.size()) return;
      if (flights_.isFixed(slot) && flights_.isFixed(other)) return;
      ClusterContact<Real> contact;
      contact.a = i;
      contact.b = j;
      contact.normal = contactNormal<Real>(dx);
      contact.gap = gap;
      contact.reach = radius + flights_.bodies[other].radius;
      const Vec pressing = flights_.acceleration(slot) - flights_.acceleration(other);
      contact.least_rebound = leastRebound<Real>(dot(pressing, contact.normal), contact.reach);
      cluster.contacts.push_back(contact);
    });
  }

  const Flights<Real, kGravity>& flights_;
  const PeriodicSpace<Real>& space_;
  const std::vector<Wall<Real>>& walls_;
  Neighbourhood<Real>& neighbourhood_;
};

}  // namespace ball_sim::core
