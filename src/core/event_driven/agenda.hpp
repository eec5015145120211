// What only the ball itself needs: its next event, its cell, and its name.
#pragma once

#include <algorithm>
#include <cstdint>

#include "ball_sim/ball.hpp"
#include "ball_sim/time_of_impact.hpp"
#include "event_driven/cell_grid.hpp"
#include "event_driven/pair_search.hpp"

namespace ball_sim::core {

/// Instead of a previous slot in a list of the event queue.
constexpr Slot kFirst = ~Slot{0};          ///< first of its list
constexpr Slot kNotQueued = ~Slot{0} - 1;  ///< in none
constexpr Slot kAtHand = ~Slot{0} - 2;     ///< in the bucket at hand

/// Partners from here on are walls: this plus their index.
constexpr std::uint32_t kWall = 0xF8000000;

/// In one cache line of doubles, and with the ball's place in the queue.
template <class Real>
struct alignas(64) Agenda {
  Real impact_time = kNever<Real>;    ///< s, in this year
  Real crossing_time = kNever<Real>;  ///< s, in this year: out of its cell or region
  double mass = 0;                    ///< kg
  std::uint32_t partner = 0;          ///< slot of whom it meets, or a wall
  std::uint32_t partner_version = 0;  ///< the partner's version when the impact was found
  std::uint32_t version = 0;          ///< counts the changes of this ball's trajectory
  BallId id = 0;
  CellCoordinates cell = {0, 0, 0};
  Slot next = kNoSlot;         ///< in the list of its bucket; at hand, its place there
  Slot previous = kNotQueued;  ///< likewise, or one of the marks above
  std::uint8_t level = 0;      ///< index into the grid's levels
  std::uint8_t crossing_axis = 0;
  std::int8_t crossing_direction = 0;  ///< -1 or +1

  Real due() const { return std::min(impact_time, crossing_time); }
  bool crossesFirst() const { return crossing_time < impact_time; }
};
static_assert(sizeof(Agenda<double>) == 64);

}  // namespace ball_sim::core
