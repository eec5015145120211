// What all stepping methods share.
#include "stepping/stepped_method.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "ball_sim/ball_check.hpp"
#include "ball_sim/text.hpp"
#include "capacity_bytes.hpp"

namespace ball_sim::core {

SteppedMethod::SteppedMethod(const Surroundings& surroundings, double time_step)
    : surroundings_(surroundings), clock_(time_step), near_(surroundings) {}

std::string SteppedMethod::reason() const {
  return "asked for, in steps of " + formatShort(timeStep()) + " s";
}

// --- balls

std::vector<Slot>::const_iterator SteppedMethod::find(BallId id) const {
  return std::lower_bound(slots_.begin(), slots_.end(), id,
                          [this](Slot slot, BallId other) { return ids_[slot] < other; });
}

Slot SteppedMethod::takeSlot() {
  if (!free_slots_.empty()) {
    const Slot slot = free_slots_.back();
    free_slots_.pop_back();
    return slot;
  }
  bodies_.emplace_back();
  accelerations_.emplace_back(Vector3::Zero());
  ids_.emplace_back();
  masses_.emplace_back();
  changes_.emplace_back();
  asleep_.emplace_back();
  return static_cast<Slot>(bodies_.size() - 1);
}

void SteppedMethod::insert(BallId id, const Ball& ball) {
  assert(slots_.empty() || ids_[slots_.back()] < id);
  const Slot slot = takeSlot();
  note(slot, Change::is_new);
  bodies_[slot].radius = ball.radius;
  bodies_[slot].w = 1 / ball.mass;
  asleep_[slot] = 0;
  masses_[slot] = ball.mass;
  ids_[slot] = id;
  slots_.push_back(slot);
  setMotionNow(slot, ball.position, ball.velocity);
}

void SteppedMethod::remove(BallId id) {
  const auto found = find(id);
  const Slot slot = *found;
  note(slot, Change::is_new);
  bodies_[slot].w = 0;
  slots_.erase(found);
  free_slots_.push_back(slot);
}

void SteppedMethod::setMotion(BallId id, const Vector3& position, const Vector3& velocity) {
  const Slot slot = *find(id);
  note(slot, Change::is_new);
  setMotionNow(slot, position, velocity);
}

void SteppedMethod::setVelocity(BallId id, const Vector3& velocity) {
  const Slot slot = *find(id);
  note(slot, Change::is_pushed);
  const Vector3 position = positionNow(slot);
  const double t = sinceStep();
  SteppedBall& body = bodies_[slot];
  body.v = velocity - t * accelerations_[slot];
  if (t != 0) body.x = position - t * (body.v + (t / 2) * accelerations_[slot]);
}

// The motion at the last step that free flight leads to this one now.
void SteppedMethod::setMotionNow(Slot slot, const Vector3& position, const Vector3& velocity) {
  SteppedBall& body = bodies_[slot];
  accelerations_[slot] = body.w > 0 ? surroundings_.gravity : Vector3(Vector3::Zero());
  const double t = sinceStep();
  body.v = velocity - t * accelerations_[slot];
  body.x = position - t * (body.v + (t / 2) * accelerations_[slot]);
}

// Notes a change that is about to be made.
void SteppedMethod::note(Slot slot, Change change) {
  if (movers_.empty()) clock_.start(now_);
  changes_[slot] = std::max(changes_[slot], change);
  is_changed_ = true;
}

// --- time

bool SteppedMethod::advanceTo(Time target, std::uint64_t max_events) {
  std::uint64_t events = 0;
  while (true) {
    if (is_changed_) takeUpChanges();
    if (!is_sorted_) sortMovers();
    if (movers_.empty() || !clock_.isDue(target)) break;
    if (events >= max_events) return false;
    clock_.tick();
    now_ = clock_.last();
    step();
    events += movers_.size();
    statistics_.events += movers_.size();
  }
  now_ = target;
  return true;
}

// After balls were put in, moved or taken out: who moves, and what is near, begins anew.
void SteppedMethod::takeUpChanges() {
  ballsChanged();
  near_.forgetContactsIf([this](const NearPair& pair) {
    return isNew(pair.a) || (!isWithWall(pair) && isNew(pair.b));
  });
  std::fill(changes_.begin(), changes_.end(), Change::none);
  is_changed_ = false;
  is_sorted_ = false;
}

void SteppedMethod::setAsleep(Slot slot, bool asleep) {
  asleep_[slot] = asleep ? 1 : 0;
  is_sorted_ = false;
}

void SteppedMethod::sortMovers() {
  movers_.clear();
  still_.clear();
  for (const Slot slot : slots_) {
    const bool moves = bodies_[slot].w > 0 && !isAsleep(slot);
    (moves ? movers_ : still_).push_back(slot);
  }
  std::sort(movers_.begin(), movers_.end());
  near_.invalidate();
  is_sorted_ = true;
  moversChanged();
}

void SteppedMethod::updatePairs() {
  const double distance = std::sqrt(fastest_squared_) * timeStep();
  near_.noteMove(distance);
  if (!near_.isGood()) near_.list(bodies_, movers_, still_, distance, margin_);
}

std::string SteppedMethod::warningOfFarMoves() const {
  if (farthest_ == 0) return {};
  return std::string(name()) + ": a ball moved by " + formatShort(farthest_) +
         " of its radius in one time_step of " + formatShort(timeStep()) + " s: beyond " +
         formatShort(kFarthestMove) +
         " balls pass through each other unseen; take a shorter time_step or method event_driven";
}

// --- reading

Vector3 SteppedMethod::positionNow(Slot slot) const {
  const double t = sinceStep();
  return bodies_[slot].x + t * (bodies_[slot].v + (t / 2) * accelerations_[slot]);
}

Vector3 SteppedMethod::velocityNow(Slot slot) const {
  return bodies_[slot].v + sinceStep() * accelerations_[slot];
}

void SteppedMethod::read(BallStates& states) const {
  states.time = now();
  states.ids.resize(slots_.size());
  states.positions.resize(slots_.size());
  states.velocities.resize(slots_.size());
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    states.ids[i] = ids_[slots_[i]];
    states.positions[i] = wrapped(positionNow(slots_[i]), surroundings_);
    states.velocities[i] = velocityNow(slots_[i]);
  }
}

Ball SteppedMethod::ball(BallId id) const {
  const Slot slot = *find(id);
  return {wrapped(positionNow(slot), surroundings_), velocityNow(slot), bodies_[slot].radius,
          masses_[slot]};
}

std::optional<BallId> SteppedMethod::findOverlap(const Vector3& position, double radius,
                                                 std::optional<BallId> ignore) const {
  for (const Slot slot : slots_) {
    if (ids_[slot] == ignore) continue;
    const Vector3 between = separation(position, positionNow(slot), surroundings_);
    if (overlapping(between, radius + bodies_[slot].radius)) return ids_[slot];
  }
  return std::nullopt;
}

Statistics SteppedMethod::statistics() const {
  Statistics statistics = statistics_;
  statistics.bytes = near_.bytes() + capacityBytes(bodies_) + capacityBytes(accelerations_) +
                     capacityBytes(ids_) + capacityBytes(masses_) + capacityBytes(changes_) +
                     capacityBytes(asleep_) + capacityBytes(slots_) + capacityBytes(free_slots_) +
                     capacityBytes(movers_) + capacityBytes(still_);
  return statistics;
}

void SteppedMethod::report(const NearPair& pair, const Vector3& normal, double impulse,
                           double approach_speed) {
  if (log_ == nullptr) return;
  const SteppedBall& ball = bodies_[pair.a];
  Collision collision;
  collision.time = stepDate();
  collision.a = ids_[pair.a];
  collision.b = isWithWall(pair) ? wallOf(pair).partner : Partner{ids_[pair.b]};
  collision.point = wrapped(ball.x + ball.radius * normal, surroundings_);
  collision.normal = normal;
  collision.impulse = impulse;
  collision.approach_speed = approach_speed;
  log_->add(collision);
}

}  // namespace ball_sim::core
