#include "ball_sim/auto_method.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "ball_sim/ball_check.hpp"
#include "ball_sim/observables.hpp"
#include "ball_sim/overlap_index.hpp"
#include "ball_sim/text.hpp"
#include "ball_sim/walls.hpp"

namespace ball_sim::core {
namespace {

// A look costs a pass over all balls: seldom enough to cost a percent. Where impacts come one by
// one, few of them say nothing.
constexpr std::uint64_t kFewestImpacts = 4096;
constexpr std::uint64_t kEventsPerBallAndLook = 16;

// Of a hum at 1e-6 of the sum of radii a ball has hundreds of impacts in the time it takes to fall
// by its radius, and as many in the time it takes to move by it; a dense fluid has tens.
constexpr double kFloodEvents = 100;
constexpr int kFloodWindows = 2;

// Another method has to be that much cheaper, so long, before a change pays.
constexpr double kMuchCheaper = 1.5;
constexpr int kDearWindows = 4;

constexpr double kTouching = 1e-6;   // of a radius: nearer is as good as in touch
constexpr double kFirstStay = 10;    // falls by a radius, of stepping before the way back is open
constexpr double kFarPerStep = 0.5;  // of the smallest radius: further, and impacts are missed

bool isAmong(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

void addTo(Statistics& sum, const Statistics& more) {
  sum.ball_collisions += more.ball_collisions;
  sum.wall_collisions += more.wall_collisions;
  sum.events += more.events;
  sum.virial += more.virial;
  sum.deepest_overlap = std::max(sum.deepest_overlap, more.deepest_overlap);
  sum.ambiguous_impacts += more.ambiguous_impacts;
}

}  // namespace

AutoMethod::AutoMethod(const Surroundings& surroundings, const MethodSettings& settings,
                       const MethodChoice& first)
    : surroundings_(surroundings),
      settings_(settings),
      gravity_(std::sqrt(dot(surroundings.gravity, surroundings.gravity))),
      choices_(methodsThatKeep(settings.simultaneous_impacts)),
      keeps_energy_(surroundings.restitution == 1),
      can_pile_(gravity_ > 0 && surroundings.restitution < 1 && isAmong(choices_, "discrete")),
      exact_name_(first.name),
      exact_reason_(first.reason),
      method_(make(first.name)) {}

std::string AutoMethod::reason() const {
  std::string text = exact_reason_;
  if (!change_.empty()) text = change_ + "; at the start: " + text;
  if (beyondHorizon()) {
    text +=
        "; beyond the horizon places are one outcome of many, while what is conserved and averages "
        "stay right";
  }
  return text;
}

std::string AutoMethod::warning() const {
  std::string text;
  for (const std::string& one : {method_->warning(), overlapWarning(), energyWarning()}) {
    if (!one.empty()) text += (text.empty() ? "" : "; ") + one;
  }
  return text;
}

// An exact method overlaps balls by rounding, or by what a stepping one left it.
std::string AutoMethod::overlapWarning() const {
  const double overlap = method_->statistics().deepest_overlap;
  const double limit = settings_.tolerance.value_or(kVisibleError) * numbers_.smallest_radius;
  if (stepping_ || !(overlap > std::max(limit, before_.deepest_overlap))) return {};
  return "balls overlapped by " + formatShort(overlap) + " m at an impact, and " +
         formatShort(limit) +
         " m is the tolerance: places are wrong by as much; see that none is put into another";
}

std::string AutoMethod::energyWarning() const {
  const double limit = settings_.tolerance.value_or(kVisibleError);
  if (!(energy_drift_ > limit)) return {};
  return "energy has drifted by " + formatShort(energy_drift_) +
         " of that of motion where impacts keep it, and " + formatShort(limit) +
         " is the tolerance: speeds are wrong by half of that; precision long_double tells "
         "whether it is rounding";
}

void AutoMethod::insert(BallId id, const Ball& ball) {
  method_->insert(id, ball);
  balls_.push_back({id, ball.radius, ball.mass});
  movable_ += std::isinf(ball.mass) ? 0 : 1;
  outsideChange();
}

void AutoMethod::remove(BallId id) {
  method_->remove(id);
  const auto found =
      std::lower_bound(balls_.begin(), balls_.end(), id,
                       [](const Properties& ball, BallId other) { return ball.id < other; });
  movable_ -= std::isinf(found->mass) ? 0 : 1;
  balls_.erase(found);
  outsideChange();
}

void AutoMethod::setMotion(BallId id, const Vector3& position, const Vector3& velocity) {
  method_->setMotion(id, position, velocity);
  outsideChange();
}

void AutoMethod::setVelocity(BallId id, const Vector3& velocity) {
  method_->setVelocity(id, velocity);
  outsideChange();
}

// Nothing counted before tells of what comes now.
void AutoMethod::outsideChange() {
  changed_outside_ = true;
  floods_ = dearer_ = 0;
  energy_limit_ = std::numeric_limits<double>::infinity();  // until the next look
  startWindow();
}

void AutoMethod::startWindow() {
  const Statistics counted = method_->statistics();
  window_start_ = now();
  window_events_ = counted.events;
  window_collisions_ = counted.ball_collisions;
}

std::uint64_t AutoMethod::eventsToLook(std::uint64_t counted) const {
  const std::uint64_t length =
      kEventsPerBallAndLook * balls_.size() + (stepping_ ? 1 : kFewestImpacts);
  const std::uint64_t passed = counted - window_events_;
  return passed < length ? length - passed : 0;
}

bool AutoMethod::advanceTo(Time target, std::uint64_t max_events) {
  if (numbers_.balls == 0 && movable_ > 0) {
    survey();
    if (can_pile_ && liesStill())
      startStepping("all balls lie still, upon one another or on walls");
  }
  std::uint64_t counted = method_->statistics().events;
  while (true) {
    const std::uint64_t before = counted;
    const bool reached = method_->advanceTo(target, std::min(max_events, eventsToLook(before)));
    counted = method_->statistics().events;
    max_events -= std::min(max_events, counted - before);
    if (eventsToLook(counted) == 0) {
      judge(look());
      startWindow();
      counted = window_events_;
    }
    if (reached) return true;
    if (max_events == 0) return false;
  }
}

AutoMethod::Look AutoMethod::look() {
  Look look;
  const Statistics counted = method_->statistics();
  const double ball_seconds =
      (now() - window_start_) * static_cast<double>(std::max<std::size_t>(1, movable_));
  look.event_rate = static_cast<double>(counted.events - window_events_) / ball_seconds;
  look.collision_rate =
      2 * static_cast<double>(counted.ball_collisions - window_collisions_) / ball_seconds;
  method_->read(states_);
  std::vector<double> masses;
  speeds_.clear();
  for (std::size_t i = 0; i < balls_.size(); ++i) {
    masses.push_back(balls_[i].mass);
    if (std::isinf(balls_[i].mass)) continue;
    speeds_.push_back(std::sqrt(dot(states_.velocities[i], states_.velocities[i])));
    look.mean_speed += speeds_.back() / static_cast<double>(movable_);
    look.fastest = std::max(look.fastest, speeds_.back());
  }
  look.kinetic = kineticEnergy(states_, masses);
  look.potential = potentialEnergy(states_, masses, surroundings_.gravity);
  if (!speeds_.empty()) {
    const auto middle = speeds_.begin() + static_cast<std::ptrdiff_t>(speeds_.size() / 2);
    std::nth_element(speeds_.begin(), middle, speeds_.end());
    look.median_speed = *middle;
  }
  if (changed_outside_) survey();
  watchEnergy(look);
  return look;
}

// Takes the scene's numbers anew.
void AutoMethod::survey() {
  method_->read(states_);
  std::vector<Ball> balls;
  std::vector<double> masses;
  for (std::size_t i = 0; i < balls_.size(); ++i) {
    balls.push_back(
        {states_.positions[i], states_.velocities[i], balls_[i].radius, balls_[i].mass});
    masses.push_back(balls_[i].mass);
  }
  numbers_ = sceneNumbers(surroundings_, balls);
  most_kinetic_ = kineticEnergy(states_, masses);
  energy_kept_ = most_kinetic_ + potentialEnergy(states_, masses, surroundings_.gravity);
  changed_outside_ = false;
}

void AutoMethod::watchEnergy(const Look& look) {
  if (!keeps_energy_) return;
  most_kinetic_ = std::max(most_kinetic_, look.kinetic);
  const double drift = std::abs(look.energy() - energy_kept_);
  if (drift > 0) energy_drift_ = std::max(energy_drift_, drift / most_kinetic_);
}

void AutoMethod::judge(const Look& look) {
  if (movable_ == 0) return;
  if (stepping_) {
    judgeStepping(look);
  } else {
    judgeExact(look);
  }
}

void AutoMethod::judgeExact(const Look& look) {
  floods_ = floods(look) ? floods_ + 1 : 0;
  if (floods_ < kFloodWindows) {
    considerCheaper(look);
    return;
  }
  startStepping(formatShort(look.event_rate) +
                " events per ball and second where balls lie on balls");
  energy_limit_ = energyLimit(look);
}

void AutoMethod::startStepping(const std::string& reason) {
  // A flood soon after the pile was stirred: next time the way back opens later.
  const bool soon = changes_ > 0 && now() - changed_at_ < 10 * stay_;
  stay_ = soon ? 2 * stay_ : kFirstStay * fallTime();
  changeTo("discrete", reason + "; steps of " + formatShort(steppingStep()) +
                           " s until they are stirred" +
                           (settings_.tolerance ? "" : ", exact no longer"));
}

// Whether nothing moves, and every ball that can has something below it that it touches.
bool AutoMethod::liesStill() const {
  const auto moves = [](const Vector3& v) { return dot(v, v) > 0; };
  if (std::any_of(states_.velocities.begin(), states_.velocities.end(), moves)) return false;
  OverlapIndex index(surroundings_);
  for (std::size_t i = 0; i < balls_.size(); ++i) {
    index.insert(i, states_.positions[i], balls_[i].radius);
  }
  const std::vector<Wall<double>> walls = wallsOf<double>(surroundings_);
  std::vector<std::size_t> touched;
  for (std::size_t i = 0; i < balls_.size(); ++i) {
    if (std::isinf(balls_[i].mass)) continue;
    const Vector3& x = states_.positions[i];
    const double reach = balls_[i].radius * (1 + kTouching);
    const auto holds = [&](const Wall<double>& wall) {
      return dot(wall.normal, surroundings_.gravity) < 0 &&
             dot(x, wall.normal) - wall.offset < reach;
    };
    const auto is_below = [&](std::size_t other) {
      const Vector3 way = separation(x, states_.positions[other], surroundings_);
      return dot(way, surroundings_.gravity) > 0;
    };
    index.findAll(x, reach, touched);
    if (std::none_of(walls.begin(), walls.end(), holds) &&
        std::none_of(touched.begin(), touched.end(), is_below)) {
      return false;
    }
  }
  return true;
}

// Left alone, a pile has no more energy than now, but for what resting contacts hold in overlap and
// what a step of free fall is off by: less than lifts every ball by its radius.
double AutoMethod::energyLimit(const Look& look) const {
  double weight = 0;  // N
  for (const Properties& ball : balls_) weight += std::isinf(ball.mass) ? 0 : gravity_ * ball.mass;
  return look.energy() + weight * numbers_.mean_radius;
}

// Whether nearly all events are those of balls that are held up by others.
bool AutoMethod::floods(const Look& look) const {
  if (!can_pile_) return false;
  const bool hums = look.event_rate * fallTime() > kFloodEvents;
  const bool stands = look.event_rate * numbers_.mean_radius > kFloodEvents * look.mean_speed;
  return hums && stands && look.event_rate * kCostOfEvent > 2 * kCostOfStep / steppingStep();
}

void AutoMethod::judgeStepping(const Look& look) {
  const std::string stirred = stirring(look);
  if (energy_limit_ == std::numeric_limits<double>::infinity()) energy_limit_ = energyLimit(look);
  if (stirred.empty() || now() - changed_at_ < stay_) return;
  changeTo(exact_name_, stirred);
}

// Why the pile is none any more; empty: it still is.
std::string AutoMethod::stirring(const Look& look) const {
  if (look.fastest * steppingStep() > kFarPerStep * numbers_.smallest_radius) {
    return "a ball moves " + formatShort(look.fastest * steppingStep() / numbers_.smallest_radius) +
           " of the smallest radius in a step";
  }
  if (look.median_speed > std::sqrt(2 * gravity_ * numbers_.mean_radius)) {
    return "stirred: half of the balls move at " + formatShort(look.median_speed) +
           " m/s or faster";
  }
  if (look.energy() > energy_limit_) return "energy has appeared";
  return "";
}

void AutoMethod::considerCheaper(const Look& look) {
  SceneNumbers now_numbers = numbers_;
  now_numbers.collision_rate = look.collision_rate;
  now_numbers.mean_speed = look.mean_speed;
  const MethodChoice best = chooseFor(now_numbers, settings_.tolerance, choices_);
  const std::optional<double> cost = estimatedCost(method_->name(), now_numbers);
  const std::optional<double> best_cost = estimatedCost(best.name, now_numbers);
  const bool dear = cost && best_cost && *cost > kMuchCheaper * *best_cost;
  dearer_ = dear ? dearer_ + 1 : 0;
  if (dearer_ < kDearWindows) return;
  exact_name_ = best.name;
  changeTo(best.name, best.reason);
}

void AutoMethod::changeTo(const std::string& name, const std::string& reason) {
  std::unique_ptr<Method> next = make(name);
  next->advanceTo(now());
  method_->read(states_);
  for (std::size_t i = 0; i < balls_.size(); ++i) {
    next->insert(balls_[i].id,
                 {states_.positions[i], states_.velocities[i], balls_[i].radius, balls_[i].mass});
  }
  next->setCollisionLog(log_);
  method_->setCollisionLog(nullptr);
  addTo(before_, method_->statistics());
  method_ = std::move(next);
  stepping_ = name == "discrete";
  changed_at_ = now();
  change_ = "since " + formatShort(now().seconds()) + " s: " + reason;
  floods_ = dearer_ = 0;
  ++changes_;
}

std::unique_ptr<Method> AutoMethod::make(const std::string& name) const {
  MethodSettings settings = settings_;
  if (name == "discrete") settings.time_step = steppingStep();
  return makeMethod(name, surroundings_, settings);
}

// The time in which a ball falls by its radius, s.
double AutoMethod::fallTime() const { return std::sqrt(2 * numbers_.mean_radius / gravity_); }

// So short that a ball at rest falls by no more than the tolerance in a step.
double AutoMethod::steppingStep() const {
  if (!settings_.tolerance) return settings_.time_step;
  const double fall = *settings_.tolerance * numbers_.smallest_radius;  // m
  return std::min(settings_.time_step, std::sqrt(fall / gravity_));
}

bool AutoMethod::beyondHorizon() const {
  if (stepping_ || !(numbers_.collision_rate > 0) || numbers_.areFew()) return false;
  const double per_ball = 2 * static_cast<double>(statistics().ball_collisions) /
                          static_cast<double>(std::max<std::size_t>(1, movable_));
  return per_ball > horizonInCollisions(numbers_.bits_per_collision,
                                        settings_.tolerance.value_or(kVisibleError));
}

Statistics AutoMethod::statistics() const {
  Statistics sum = method_->statistics();
  addTo(sum, before_);
  return sum;
}

void AutoMethod::setCollisionLog(CollisionLog* log) {
  log_ = log;
  method_->setCollisionLog(log);
}

}  // namespace ball_sim::core
