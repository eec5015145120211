// What can be said of a state from outside.
#include "state_check.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "ball_sim/ball_check.hpp"
#include "ball_sim/observables.hpp"
#include "ball_sim/overlap_index.hpp"
#include "ball_sim/walls.hpp"

namespace ball_sim::core::chart {
namespace {

double wallOverlap(const PreparedScene& scene, const BallStates& states) {
  double deepest = 0;
  for (const Wall<double>& wall : wallsOf<double>(scene.surroundings)) {
    for (std::size_t i = 0; i < states.ids.size(); ++i) {
      const double gap = dot(states.positions[i], wall.normal) - wall.offset;
      deepest = std::max(deepest, scene.balls[i].radius - gap);
    }
  }
  return deepest;
}

bool leftThroughWall(const PreparedScene& scene, const BallStates& states) {
  for (const Wall<double>& wall : wallsOf<double>(scene.surroundings)) {
    for (std::size_t i = 0; i < states.ids.size(); ++i) {
      if (dot(states.positions[i], wall.normal) < wall.offset - scene.balls[i].radius) return true;
    }
  }
  return false;
}

}  // namespace

double deepestOverlap(const PreparedScene& scene, const BallStates& states) {
  double deepest = wallOverlap(scene, states);
  OverlapIndex index(scene.surroundings);
  std::vector<std::size_t> order(states.ids.size());  // large balls first, as the index wants it
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return scene.balls[a].radius > scene.balls[b].radius;
  });
  std::vector<std::size_t> touched;
  for (const std::size_t i : order) {
    index.findAll(states.positions[i], scene.balls[i].radius, touched);
    for (const std::size_t j : touched) {
      const Vector3 dx = separation(states.positions[i], states.positions[j], scene.surroundings);
      deepest = std::max(deepest, scene.balls[i].radius + scene.balls[j].radius - dx.norm());
    }
    index.insert(i, states.positions[i], scene.balls[i].radius);
  }
  return deepest;
}

double largestError(const PreparedScene& scene, const Trajectory& truth, double date,
                    const BallStates& states) {
  double largest = 0;
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    const Vector3 place = truth.at(static_cast<BallId>(i), date).position;
    const Vector3 off = separation(states.positions[i], place, scene.surroundings);
    largest = std::max(largest, off.norm());
  }
  return largest;
}

double energyOf(const PreparedScene& scene, const BallStates& states) {
  const std::vector<double> masses = massesOf(scene);
  return kineticEnergy(states, masses) +
         potentialEnergy(states, masses, scene.surroundings.gravity);
}

BallStates statesAt(const Trajectory& truth, double date) {
  BallStates states;
  states.time = Time::fromSeconds(date);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Trajectory::State state = truth.at(static_cast<BallId>(i), date);
    states.ids.push_back(static_cast<BallId>(i));
    states.positions.push_back(state.position);
    states.velocities.push_back(state.velocity);
  }
  return states;
}

std::string defect(const PreparedScene& scene, const BallStates& states, double true_energy) {
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    if (!states.positions[i].allFinite() || !states.velocities[i].allFinite()) return "not finite";
  }
  if (leftThroughWall(scene, states)) return "ball through a wall";
  if (energyOf(scene, states) > 2 * true_energy) return "energy more than doubled";
  return "";
}

bool conservesMomentum(const PreparedScene& scene) {
  return wallsOf<double>(scene.surroundings).empty() &&
         scene.surroundings.gravity == Vector3::Zero();
}

std::vector<double> massesOf(const PreparedScene& scene) {
  std::vector<double> masses;
  for (const Ball& ball : scene.balls) masses.push_back(ball.mass);
  return masses;
}

}  // namespace ball_sim::core::chart
