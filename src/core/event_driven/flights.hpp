// The balls of method event_driven: on what flight each is, and what happens to it next. A place is
// stored at a ball's own last change and nowhere else: reading, crossing and searching leave no
// trace in the trajectory.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "ball_sim/collapse_guard.hpp"
#include "ball_sim/surroundings.hpp"
#include "ball_sim/vector.hpp"
#include "capacity_bytes.hpp"
#include "event_driven/agenda.hpp"
#include "event_driven/contacts.hpp"
#include "event_driven/huge_page_vector.hpp"
#include "event_driven/pair_search.hpp"
#include "impact.hpp"
#include "permutation.hpp"

namespace ball_sim::core {

/// Arrays by slot; a slot is used again when its ball is gone.
/// @tparam kGravity  whether balls fall; without it no acceleration is stored or computed
template <class Real, bool kGravity>
struct Flights {
  using Vec = VectorOf<Real>;

  explicit Flights(const Surroundings& surroundings)
      : contacts(surroundings.gravity.cast<Real>()),
        keeps_histories(surroundings.restitution < 1) {}

  HugePageVector<Body<Real>> bodies;
  HugePageVector<Agenda<Real>> agendas;
  std::vector<ImpactHistory<Real>> histories;  ///< only where restitution is below 1
  Contacts<Real> contacts;                     ///< only with gravity
  Real now = 0;                                ///< s, in this year
  bool keeps_histories;
  ImpactHistory<Real> no_history;  ///< stands in for them
  std::vector<bool> moved;         ///< scratch of moveTo()

  std::size_t size() const { return bodies.size(); }

  void resize(std::size_t count) {
    bodies.resize(count);
    agendas.resize(count);
    if (keeps_histories) histories.resize(count);
    if constexpr (kGravity) contacts.resize(count);
  }

  /// Gives the balls other slots. @param to  by slot, a permutation
  void moveTo(const std::vector<Slot>& to) {
    exchangeToPlaces(size(), to, moved, [this](Slot a, Slot b) {
      std::swap(bodies[a], bodies[b]);
      std::swap(agendas[a], agendas[b]);
      if (keeps_histories) std::swap(histories[a], histories[b]);
      if constexpr (kGravity) std::swap(contacts.numbers()[a], contacts.numbers()[b]);
    });
  }

  /// Gives back the memory that growing has left over.
  void shrink() {
    bodies.shrink_to_fit();
    agendas.shrink_to_fit();
    histories.shrink_to_fit();
    contacts.numbers().shrink_to_fit();
  }

  bool isFixed(Slot slot) const { return std::isinf(agendas[slot].mass); }
  Real inverseMass(Slot slot) const { return 1 / Real(agendas[slot].mass); }  ///< 1/kg; 0: fixed

  /// m/s^2
  Vec acceleration(Slot slot) const {
    if constexpr (kGravity) return contacts.acceleration(slot);
    return Vec::Zero();
  }

  /// m, now.
  Vec position(Slot slot) const {
    const Body<Real>& body = bodies[slot];
    const Real dt = now - body.time;
    if constexpr (kGravity) return body.x + dt * (body.v + (dt / 2) * contacts.acceleration(slot));
    return body.x + dt * body.v;
  }

  /// m/s, now.
  Vec velocity(Slot slot) const {
    const Body<Real>& body = bodies[slot];
    if constexpr (kGravity) return body.v + (now - body.time) * contacts.acceleration(slot);
    return body.v;
  }

  /// Stores the place of now, for a change of velocity to start from.
  void settle(Slot slot) {
    Body<Real>& body = bodies[slot];
    body.x = position(slot);
    body.v = velocity(slot);
    body.time = now;
  }

  /// The ball as a partner of an impact. It must be settled.
  Impacting<Real> impacting(Slot slot) {
    return {bodies[slot].v, inverseMass(slot), keeps_histories ? histories[slot] : no_history};
  }

  /// Sets all clocks back.
  /// @param by      s
  /// @param oldest  s: places stored longer ago are stored anew, as their times would lose digits
  void setBack(Real by, Real oldest) {
    now -= by;
    for (Slot slot = 0; slot < size(); ++slot) {
      bodies[slot].time -= by;
      agendas[slot].impact_time -= by;
      agendas[slot].crossing_time -= by;
      if (keeps_histories) histories[slot].last -= by;
      if (bodies[slot].time < -oldest) settle(slot);
    }
  }

  std::size_t bytes() const {
    return capacityBytes(bodies) + capacityBytes(agendas) + capacityBytes(histories) +
           contacts.bytes() + moved.capacity() / 8;
  }
};

}  // namespace ball_sim::core
