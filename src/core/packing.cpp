// Finds places for balls that overlap nothing: at random while that is quick, else by pushing balls
// apart, else on a lattice.
#include "packing.hpp"

#include <algorithm>
#include <cstdio>
#include <string>

#include "ball_sim/ball_check.hpp"
#include "ball_sim/fill.hpp"
#include "ball_sim/text.hpp"
#include "packing_lattice.hpp"
#include "packing_relaxation.hpp"
#include "packing_room.hpp"
#include "pi.hpp"

namespace ball_sim::core {
namespace {

// Random sequential addition of equal balls comes to an end at a packing fraction of 0.382 in space
// and 0.547 in the plane; well before that it is quick. Source: Torquato, Uche, Stillinger,
// Physical Review E 74, 061308 (2006).
constexpr double kQuickInSpace = 0.30;
constexpr double kQuickInPlane = 0.44;

// With very many equal balls, for which a lattice takes no time at all.
constexpr double kQuickForManyInSpace = 0.10;
constexpr double kQuickForManyInPlane = 0.15;

// Tries a ball, all balls together, and for a single one.
constexpr std::size_t kTriesPerBall = 40;
constexpr std::size_t kTriesForOne = 20000;

// Equal balls jam when they are pushed apart from random places: at 0.64 in space and 0.84 in the
// plane. Source: O'Hern, Langer, Liu, Nagel, Physical Review Letters 88, 075507 (2002).
constexpr double kJammedInSpace = 0.63;
constexpr double kJammedInPlane = 0.83;

// Small balls fit between large ones, but beyond this a try would only cost time.
constexpr double kUnequalJammedInSpace = 0.74;
constexpr double kUnequalJammedInPlane = 0.90;

// Pushing apart moves all balls many times: with more of them than this, a lattice is quicker.
constexpr std::size_t kManyBalls = 20000;

// Share of the box's volume (planar: area) that the balls take up.
double packingFraction(const std::vector<Ball>& balls, const std::vector<Ball>& present,
                       const Surroundings& surroundings) {
  const bool planar = surroundings.planar();
  double content = 0;
  for (const std::vector<Ball>* some : {&balls, &present}) {
    for (const Ball& ball : *some) {
      const double r = ball.radius;
      content += planar ? kPi * r * r : 4.0 / 3.0 * kPi * r * r * r;
    }
  }
  for (int axis = 0; axis < axesOf(surroundings); ++axis) {
    content /= surroundings.box.max[axis] - surroundings.box.min[axis];
  }
  return content;
}

// A ball for which there is no room at all, even alone, is refused first.
void demandRoom(const std::vector<Ball>& balls, const Surroundings& surroundings) {
  double largest = 0;
  for (const Ball& ball : balls) largest = std::max(largest, ball.radius);
  const Box& box = surroundings.box;
  for (int axis = 0; axis < axesOf(surroundings); ++axis) {
    const double extent = box.max[axis] - box.min[axis];
    if (extent >= 2 * largest) continue;
    throw PackingError("a ball of radius " + formatNumber(largest) +
                       " m is wider than the box, which has " + formatNumber(extent) + " m along " +
                       std::string(1, "xyz"[axis]));
  }
}

Vector3 drawPlace(const Box& room, RandomSource& random) {
  Vector3 place = room.min;
  for (int axis = 0; axis < 3; ++axis) {
    if (room.max[axis] > room.min[axis]) {
      place[axis] = random.uniform(room.min[axis], room.max[axis]);
    }
  }
  return place;
}

// Random sequential addition: each ball in turn, largest first, goes to the first free place drawn.
// @return how many found one
std::size_t addSequentially(std::vector<Ball>& balls, const Surroundings& surroundings,
                            const std::vector<Ball>& present, RandomSource& random) {
  OverlapIndex index = indexOf(present, surroundings);
  std::size_t tries_left = kTriesForOne + kTriesPerBall * balls.size();
  std::size_t placed = 0;
  for (const std::size_t i : bySize(balls)) {
    Ball& ball = balls[i];
    const Box room = centresWithin(surroundings, ball.radius);
    do {
      if (tries_left-- == 0) return placed;
      ball.position = drawPlace(room, random);
    } while (index.overlapsAny(ball.position, ball.radius) ||
             checkPlace(ball.position, ball.radius, surroundings));
    index.insert(i, ball.position, ball.radius);
    ++placed;
  }
  return placed;
}

double quickFraction(bool planar, bool lattice_is_quicker) {
  if (lattice_is_quicker) return planar ? kQuickForManyInPlane : kQuickForManyInSpace;
  return planar ? kQuickInPlane : kQuickInSpace;
}

double jammedFraction(bool planar, bool equal) {
  if (equal) return planar ? kJammedInPlane : kJammedInSpace;
  return planar ? kUnequalJammedInPlane : kUnequalJammedInSpace;
}

bool equalRadii(const std::vector<Ball>& balls) {
  return std::all_of(balls.begin(), balls.end(),
                     [&balls](const Ball& ball) { return ball.radius == balls.front().radius; });
}

}  // namespace

void placeBalls(std::vector<Ball>& balls, const Surroundings& surroundings,
                const std::vector<Ball>& present, RandomSource& random) {
  if (balls.empty()) return;
  demandRoom(balls, surroundings);
  const double fraction = packingFraction(balls, present, surroundings);
  const bool equal = equalRadii(balls);  // nothing else has a lattice to go to
  const bool many = balls.size() > kManyBalls;
  std::size_t placed = 0;
  if (fraction <= quickFraction(surroundings.planar(), equal && many)) {
    placed = addSequentially(balls, surroundings, present, random);
    if (placed == balls.size()) return;
  }
  const double jammed = jammedFraction(surroundings.planar(), equal);
  const bool lattice_first = many || fraction > jammed;
  if (equal && lattice_first && placeOnLattice(balls, surroundings, present, random)) return;
  if (fraction < jammed) {
    placed = std::max(placed, relax(balls, surroundings, present, random));
    if (placed == balls.size()) return;
  }
  if (equal && !lattice_first && placeOnLattice(balls, surroundings, present, random)) return;
  placed = std::max(placed, addSequentially(balls, surroundings, present, random));
  char share[32];
  std::snprintf(share, sizeof share, "%.3g", fraction);
  throw PackingError("only " + std::to_string(placed) + " of " + std::to_string(balls.size()) +
                     " balls found a place without overlap (all would take up " + share +
                     " of the box): take fewer or smaller balls, or a larger box");
}

}  // namespace ball_sim::core
