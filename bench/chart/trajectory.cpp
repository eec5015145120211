// The true motion of a scene's balls.
#include "trajectory.hpp"

#include <algorithm>

#include "ball_sim/brute_force.hpp"
#include "multiprecision.hpp"
#include "oracle.hpp"

namespace ball_sim::core::chart {

Impact impactOf(BallId a, Partner b) {
  if (b >= 0 && b < static_cast<Partner>(a)) return {static_cast<BallId>(b), a};
  return {a, b};
}

Trajectory::Trajectory(const std::vector<Ball>& balls, const Vector3& acceleration)
    : flights_(balls.size()), acceleration_(acceleration) {
  for (std::size_t i = 0; i < balls.size(); ++i) {
    flights_[i].push_back({0, {balls[i].position, balls[i].velocity}});
  }
}

void Trajectory::add(BallId id, double seconds, const State& state) {
  flights_[id].push_back({seconds, state});
}

void Trajectory::addImpact(double seconds, const Impact& impact) {
  impacts_.push_back({seconds, impact});
}

Trajectory::State Trajectory::at(BallId id, double seconds) const {
  const std::vector<Flight>& flights = flights_[id];
  const auto next =
      std::upper_bound(flights.begin() + 1, flights.end(), seconds,
                       [](double date, const Flight& flight) { return date < flight.begin; });
  const Flight& flight = *(next - 1);
  const double t = seconds - flight.begin;
  return {flight.state.position + t * (flight.state.velocity + (t / 2) * acceleration_),
          flight.state.velocity + t * acceleration_};
}

std::vector<Impact> Trajectory::impactsWithin(double from, double to) const {
  std::vector<Impact> met;
  for (const DatedImpact& dated : impacts_) {
    if (dated.date > from && dated.date <= to) met.push_back(dated.impact);
  }
  std::sort(met.begin(), met.end());
  return met;
}

Trajectory record(Method& method, const PreparedScene& scene, double until) {
  Trajectory trajectory(scene.balls, scene.surroundings.gravity);
  CollisionLog log;
  method.setCollisionLog(&log);
  // After the last impact the method goes on to the end at once: the ball is followed back.
  const auto keep = [&](BallId id, const Time& date) {
    const Ball ball = method.ball(id);
    const double since = method.now() - date;
    const Vector3 velocity = ball.velocity - since * scene.surroundings.gravity;
    const Vector3 mean = (ball.velocity + velocity) / 2;
    trajectory.add(id, date.seconds(), {ball.position - since * mean, velocity});
  };
  const Time target = Time::fromSeconds(until);
  bool there = false;
  while (!there) {
    there = method.advanceTo(target, 1);
    for (const Collision& collision : log.entries) {
      keep(collision.a, collision.time);
      if (collision.b >= 0) keep(static_cast<BallId>(collision.b), collision.time);
      trajectory.addImpact(collision.time.seconds(), impactOf(collision.a, collision.b));
    }
    log.entries.clear();
  }
  method.setCollisionLog(nullptr);
  return trajectory;
}

Trajectory allPairsTrajectory(const PreparedScene& scene, double until) {
  BruteForce<Multiprecision> method(scene.surroundings);
  for (std::size_t i = 0; i < scene.balls.size(); ++i) {
    method.insert(static_cast<BallId>(i), scene.balls[i]);
  }
  return record(method, scene, until);
}

Trajectory trueTrajectory(const PreparedScene& scene, double until) {
  switch (scene.plan.truth) {
    case Truth::at_rest:
      return {scene.balls, Vector3::Zero()};
    case Truth::oracle:
      return oracleTrajectory(scene, until);
    case Truth::all_pairs:
      break;
  }
  return allPairsTrajectory(scene, until);
}

}  // namespace ball_sim::core::chart
