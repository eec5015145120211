// What keeps balls from falling freely: most do, and cost nothing here; the few that are fixed or
// rest on walls have a contact each.
#pragma once

#include <cstdint>
#include <vector>

#include "ball_sim/walls.hpp"
#include "event_driven/pair_search.hpp"

namespace ball_sim::core {

template <class Real>
class Contacts {
  using Vec = VectorOf<Real>;

 public:
  /// @param gravity  m/s^2
  explicit Contacts(const Vec& gravity) {
    contacts_.resize(2);
    contacts_[kFree].acceleration = gravity;
  }

  void resize(std::size_t slots) { contact_of_.resize(slots, kFree); }

  /// The numbers by slot, for the owner to reorder; 0 means none.
  std::vector<std::uint32_t>& numbers() { return contact_of_; }

  bool fallsFreely(Slot slot) const { return contact_of_[slot] == kFree; }
  const Vec& acceleration(Slot slot) const { return contacts_[contact_of_[slot]].acceleration; }
  bool isRestingOn(Slot slot, int wall) const {
    return contacts_[contact_of_[slot]].walls.includes(wall);
  }

  /// A new ball, or one put elsewhere: it touches nothing.
  void release(Slot slot, bool fixed) {
    drop(slot);
    contact_of_[slot] = fixed ? kFixed : kFree;
  }

  void rest(Slot slot, int wall) {
    if (contact_of_[slot] == kFree) contact_of_[slot] = take();
    contacts_[contact_of_[slot]].walls.add(wall);
  }

  /// After any change of its velocity a ball leaves the walls it rests on, or slides along them.
  /// @param v  m/s; see settleContacts()
  void velocityChanged(Slot slot, Vec& v, Real radius, const std::vector<Wall<Real>>& walls) {
    if (contact_of_[slot] <= kFixed) return;
    Contact& contact = contacts_[contact_of_[slot]];
    contact.acceleration =
        settleContacts<Real>(contact.walls, v, radius, contacts_[kFree].acceleration, walls);
    if (contact.walls.count == 0) drop(slot);
  }

  std::size_t bytes() const {
    return contact_of_.capacity() * sizeof(std::uint32_t) + contacts_.capacity() * sizeof(Contact);
  }

 private:
  static constexpr std::uint32_t kFree = 0;
  static constexpr std::uint32_t kFixed = 1;

  struct Contact {
    RestingContacts walls;
    Vec acceleration = Vec::Zero();  // m/s^2
  };

  std::uint32_t take() {
    if (unused_.empty()) {
      contacts_.emplace_back();
      return static_cast<std::uint32_t>(contacts_.size() - 1);
    }
    const std::uint32_t number = unused_.back();
    unused_.pop_back();
    contacts_[number].walls = RestingContacts();
    return number;
  }

  void drop(Slot slot) {
    if (contact_of_[slot] > kFixed) unused_.push_back(contact_of_[slot]);
    contact_of_[slot] = kFree;
  }

  std::vector<std::uint32_t> contact_of_;  // by slot, index into contacts_
  std::vector<Contact> contacts_;          // first of balls that fall freely, then of fixed ones
  std::vector<std::uint32_t> unused_;
};

}  // namespace ball_sim::core
