// The world: balls, their surroundings and the method that moves them, behind one checked door.
#include "ball_sim/world.hpp"

#include <algorithm>
#include <cmath>

#include "ball_sim/auto_method.hpp"
#include "ball_sim/ball_check.hpp"
#include "ball_sim/fill.hpp"
#include "ball_sim/limits.hpp"
#include "ball_sim/observables.hpp"
#include "ball_sim/overlap_index.hpp"
#include "ball_sim/text.hpp"
#include "fitting_step.hpp"
#include "soft_sphere/contact_spring.hpp"

namespace ball_sim::core {
namespace {

constexpr double kLargestId = std::numeric_limits<BallId>::max();

Refusal overlapRefusal(const std::string& subject, const Ball& ball, const std::string& other_name,
                       const Ball& other, const Surroundings& surroundings) {
  const Vector3 between = separation(ball.position, other.position, surroundings);
  return {RefusalCode::overlap,
          subject + " " + overlapText(other_name, between.norm(), ball.radius + other.radius)};
}

std::string listedName(std::size_t index) { return "balls[" + std::to_string(index) + "]"; }

// The balls a scene lists must each be valid, and overlap none.
void checkInitial(const std::vector<Ball>& balls, const Surroundings& surroundings) {
  std::vector<bool> all(balls.size(), true);
  for (std::size_t i = 0; i < balls.size(); ++i) {
    if (const Refusal r = checkBall(balls[i], surroundings)) {
      throw Refused({r.code, listedName(i) + ": " + r.reason});
    }
  }
  const auto overlaps = overlapsAmong(balls, all, surroundings);
  for (std::size_t i = 0; i < balls.size(); ++i) {
    if (!overlaps[i]) continue;
    throw Refused(overlapRefusal(listedName(i) + ":", balls[i], listedName(*overlaps[i]),
                                 balls[*overlaps[i]], surroundings));
  }
}

Refusal ballLimit(std::size_t present, std::size_t more, std::size_t limit) {
  return {RefusalCode::ball_limit, std::to_string(more) + " more balls refused: there are " +
                                       std::to_string(present) + ", and max_balls is " +
                                       std::to_string(limit)};
}

Refusal unknownBall(const std::string& ids, bool several) {
  return {RefusalCode::unknown_ball,
          (several ? "no balls have the ids " : "no ball has the id ") + ids};
}

}  // namespace

World::World(const Scene& scene, const WorldOptions& options) : scene_(scene), options_(options) {
  if (!options_.method.empty()) scene_.method = options_.method;
  if (options_.time_step) scene_.time_step = options_.time_step;
  if (options_.tolerance) scene_.tolerance = options_.tolerance;
  if (scene_.time_step) checkTimeStep(*scene_.time_step);
  if (scene_.tolerance) checkTolerance(*scene_.tolerance);
  checkMethodName(scene_.method);
  std::size_t count = scene_.balls.size();
  for (const Fill& fill : scene_.fill) count += fill.count;
  if (count > options_.max_balls) throw Refused(ballLimit(0, count, options_.max_balls));
  initial_ = populate(scene_);
  checkInitial(initial_, scene_.surroundings);
  choice_ = chooseMethod(scene_.method, scene_, initial_);
  build(Time());
}

void World::build(Time start) {
  MethodSettings settings;
  settings.precision = options_.precision;
  settings.time_step = scene_.time_step.value_or(
      fittingTimeStep(scene_.method, initial_, scene_.surroundings, scene_.tolerance));
  settings.tolerance = scene_.tolerance;
  if (scene_.tolerance) {
    settings.contact_time = contactTimeFor(*scene_.tolerance, initial_, scene_.surroundings);
  }
  settings.simultaneous_impacts = scene_.simultaneous_impacts;
  settings.threads = options_.threads;
  std::unique_ptr<Method> method;
  if (scene_.method == "auto") {
    method = std::make_unique<AutoMethod>(scene_.surroundings, settings, choice_);
  } else {
    method = makeMethod(choice_.name, scene_.surroundings, settings);
  }
  method->advanceTo(start);
  method_ = std::move(method);
  method_->setCollisionLog(log_);
  ids_.clear();
  radii_.clear();
  masses_.clear();
  for (std::size_t i = 0; i < initial_.size(); ++i) add(static_cast<BallId>(i), initial_[i]);
}

void World::add(BallId id, const Ball& ball) {
  Ball inside = ball;
  inside.position = wrapped(ball.position, surroundings());
  method_->insert(id, inside);
  ids_.push_back(id);
  radii_.push_back(ball.radius);
  masses_.push_back(ball.mass);
  next_id_ = std::max(next_id_, id + 1);
}

bool World::advanceTo(Time target, std::uint64_t max_events) {
  if (target < now()) {
    throw std::invalid_argument("time: " + formatNumber(target.seconds()) +
                                " s: must not be before the present, " +
                                formatNumber(now().seconds()) + " s");
  }
  if (target.seconds() > kMaxTime) {
    throw std::invalid_argument("time: " + formatNumber(target.seconds()) + " s: must not exceed " +
                                formatNumber(kMaxTime) + " s");
  }
  return method_->advanceTo(target, max_events);
}

bool World::contains(BallId id) const { return std::binary_search(ids_.begin(), ids_.end(), id); }

std::size_t World::indexOf(BallId id) const {
  const auto found = std::lower_bound(ids_.begin(), ids_.end(), id);
  if (found == ids_.end() || *found != id) throw Refused(unknownBall(std::to_string(id), false));
  return static_cast<std::size_t>(found - ids_.begin());
}

Ball World::ball(BallId id) const {
  indexOf(id);
  return method_->ball(id);
}

Refusal World::check(const Ball& ball, std::optional<BallId> itself) const {
  if (Refusal r = checkBall(ball, surroundings())) return r;
  const Vector3 inside = wrapped(ball.position, surroundings());
  const std::optional<BallId> other = method_->findOverlap(inside, ball.radius, itself);
  if (!other) return {};
  return overlapRefusal("ball", ball, "ball " + std::to_string(*other), method_->ball(*other),
                        surroundings());
}

SpawnResult World::spawn(const std::vector<Ball>& balls) {
  SpawnResult result;
  if (size() + balls.size() > options_.max_balls ||
      static_cast<double>(next_id_) + static_cast<double>(balls.size()) > kLargestId) {
    result.refusals.assign(balls.size(), ballLimit(size(), balls.size(), options_.max_balls));
    return result;
  }
  bool accepted = true;
  std::vector<bool> valid(balls.size());
  for (std::size_t i = 0; i < balls.size(); ++i) {
    result.refusals.push_back(check(balls[i], std::nullopt));
    valid[i] = !result.refusals[i];
  }
  const auto overlaps = overlapsAmong(balls, valid, surroundings());
  for (std::size_t i = 0; i < balls.size(); ++i) {
    if (overlaps[i]) {
      result.refusals[i] = overlapRefusal(
          "ball", balls[i], "ball number " + std::to_string(*overlaps[i]) + " of the same request",
          balls[*overlaps[i]], surroundings());
    }
    if (result.refusals[i]) accepted = false;
  }
  if (accepted) {
    for (const Ball& ball : balls) {
      result.ids.push_back(next_id_);
      add(next_id_, ball);
    }
    return result;
  }
  for (Refusal& refusal : result.refusals) {
    if (!refusal) {
      refusal = {RefusalCode::rejected_with_others,
                 "the ball is fine, but another of the same request was refused"};
    }
  }
  return result;
}

BallId World::spawn(const Ball& ball) {
  const SpawnResult result = spawn(std::vector<Ball>{ball});
  if (!result.accepted()) throw Refused(result.refusals.front());
  return result.ids.front();
}

// `ids` are ascending, unique and all in use.
void World::takeOut(const std::vector<BallId>& ids) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    if (std::binary_search(ids.begin(), ids.end(), ids_[i])) {
      method_->remove(ids_[i]);
      continue;
    }
    ids_[kept] = ids_[i];
    radii_[kept] = radii_[i];
    masses_[kept] = masses_[i];
    ++kept;
  }
  ids_.resize(kept);
  radii_.resize(kept);
  masses_.resize(kept);
}

void World::remove(const std::vector<BallId>& ids) {
  std::vector<BallId> sorted = ids;
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  std::string unknown;
  std::size_t unknowns = 0;
  for (const BallId id : sorted) {
    if (contains(id)) continue;
    unknown += (unknowns++ == 0 ? "" : ", ") + std::to_string(id);
  }
  if (unknowns > 0) throw Refused(unknownBall(unknown, unknowns > 1));
  takeOut(sorted);
}

void World::removeAll() { takeOut(std::vector<BallId>(ids_)); }

void World::removeSpawned() {
  const auto first = std::lower_bound(ids_.begin(), ids_.end(), initial_.size());
  takeOut(std::vector<BallId>(first, ids_.end()));
}

World::VelocityChange World::applyImpulse(BallId id, const Vector3& impulse) {
  const double mass = masses_[indexOf(id)];
  if (std::isinf(mass)) {
    throw Refused({RefusalCode::fixed_ball,
                   "ball " + std::to_string(id) + " is fixed (infinite mass): nothing moves it"});
  }
  if (!impulse.allFinite()) {
    throw Refused({RefusalCode::not_finite,
                   "impulse is " + formatVector(impulse) + " N s: must be three finite numbers"});
  }
  if (surroundings().planar() && impulse.z() != 0) {
    throw Refused(
        {RefusalCode::not_planar, "impulse is " + formatVector(impulse) +
                                      " N s: the scene is planar, its z component must be 0"});
  }
  VelocityChange change;
  change.before = method_->ball(id).velocity;
  change.after = change.before + impulse / mass;
  if (change.after.cwiseAbs().maxCoeff() <= kMaxSpeed) {
    method_->setVelocity(id, change.after);
    change.after = method_->ball(id).velocity;
    return change;
  }
  throw Refused({RefusalCode::out_of_range,
                 "impulse is " + formatVector(impulse) + " N s: the ball's velocity would be " +
                     formatVector(change.after) + " m/s, and no component may exceed " +
                     formatNumber(kMaxSpeed) + " m/s"});
}

void World::setMotion(BallId id, const Vector3& position, const Vector3& velocity) {
  const std::size_t index = indexOf(id);
  if (std::isinf(masses_[index])) {
    throw Refused({RefusalCode::fixed_ball,
                   "ball " + std::to_string(id) + " is fixed (infinite mass): nothing moves it"});
  }
  const Ball moved{position, velocity, radii_[index], masses_[index]};
  if (const Refusal r = check(moved, id)) throw Refused(r);
  method_->setMotion(id, wrapped(position, surroundings()), velocity);
}

void World::reset(bool restart_time) {
  if (restart_time) next_id_ = 0;
  build(restart_time ? Time() : now());
}

double World::kineticEnergy() const {
  BallStates states;
  read(states);
  return core::kineticEnergy(states, masses_);
}

double World::potentialEnergy() const {
  BallStates states;
  read(states);
  return core::potentialEnergy(states, masses_, surroundings().gravity) +
         statistics().elastic_energy;
}

Vector3 World::momentum() const {
  BallStates states;
  read(states);
  return core::momentum(states, masses_);
}

void World::setCollisionLog(CollisionLog* log) {
  log_ = log;
  method_->setCollisionLog(log);
}

}  // namespace ball_sim::core
