// Method discrete.
#include "discrete/discrete.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "ball_sim/collision_law.hpp"
#include "ball_sim/text.hpp"

namespace ball_sim::core {
namespace {

// Contacts slower than what gravity gives in so many steps rest: a bounce that begins at this speed
// with e = 1 lasts four steps, and fewer are not a parabola.
constexpr double kRestingSteps = 2;

// The loads of a pile change little from step to step; these sweeps settle what did change.
// Measured on 1000 balls poured into a box: overshooting by 0.3 brings them to rest in half the
// time, more does not, and twenty sweeps do as well as forty.
constexpr int kMostLoadSweeps = 20;
constexpr double kOverrelaxation = 1.3;
constexpr double kLoadAccuracy = 1e-4;  // of the speed that gravity gives in a step

// A chain of touching balls passes an impulse on in one sweep when it runs up the ids, in as many
// as it is long when it runs down. What is left goes on in the next step.
constexpr int kMostImpactSweeps = 32;

// Overlap of resting contacts is taken away bit by bit, so that neighbours do not fight.
constexpr int kSeparationSweeps = 4;
constexpr double kSeparationShare = 0.3;
constexpr double kLeftOverlap = 1e-3;  // of the radius, so that contacts do not open and close

// A sleeping ball wakes when what a contact bears differs by this from what it bore when the ball
// fell asleep. Loads that are still being found vary by some percent.
constexpr double kLoadChange = 0.2;    // of the load then, and
constexpr double kWeightChange = 0.1;  // of the ball's weight

constexpr double kBeside = -0.1;  // cosine to gravity: partners not above this bear a ball

}  // namespace

Discrete::Discrete(const Surroundings& surroundings, double time_step)
    : SteppedMethod(surroundings, time_step),
      gravity_(surroundings.gravity),
      restitution_(surroundings.restitution),
      smallest_late_(std::numeric_limits<double>::infinity()),
      watch_(std::sqrt(dot(gravity_, gravity_)), time_step) {
  const double g = std::sqrt(dot(gravity_, gravity_));
  const double gained = g * time_step;  // m/s in a step
  rests_late_below_ = g * std::pow(time_step / kLongestRestingStep, 2);
  resting_speed_ = restitution_ < 1 ? kRestingSteps * gained : 0;
  setMargin(resting_speed_ > 0 ? gained * time_step : 0);
}

void Discrete::step() {
  forgetSpeeds();
  if (resting_speed_ > 0) {
    fallAndRest();
  } else {
    fall();
  }
  updatePairs();
  findContacts();
  resolveImpacts();
  if (resting_speed_ > 0) {
    markResting();
    separate();
    if (++steps_since_look_ == RestWatch::kLookEvery) {
      steps_since_look_ = 0;
      noteLateRest();
      fallAsleep();
    }
  }
}

void Discrete::ballsChanged() {
  watch_.resize(slotCount());
  drowsy_.resize(slotCount());
  const auto changed = [this](Slot slot) { return isNew(slot) || isPushed(slot); };
  for (Slot slot = 0; slot < slotCount(); ++slot) {
    if (changed(slot)) wake(slot);
  }
  near().forgetContactsIf([&](const NearPair& pair) {
    if (pair.touching && !isWithWall(pair) && (changed(pair.a) || changed(pair.b))) {
      wake(pair.a);
      wake(pair.b);
    }
    return false;
  });
}

// The contacts of the last step are between other balls, or seen from others.
void Discrete::moversChanged() {
  if (resting_speed_ == 0) return;
  updatePairs();
  findContacts();
  markResting();
}

// --- motion

void Discrete::fall() {
  const double dt = timeStep();
  for (const Slot slot : movers()) {
    SteppedBall& ball = body(slot);
    noteSpeed(ball.v, ball.radius);
    ball.x += dt * (ball.v + (dt / 2) * gravity_);
    ball.v += dt * gravity_;
    noteSpeed(ball.v, ball.radius);
  }
}

// Half the way with the velocity before, half with that after gravity and contacts: exact for balls
// that touch nothing, and no way at all for balls that rest.
void Discrete::fallAndRest() {
  const double dt = timeStep();
  for (const Slot slot : movers()) {
    SteppedBall& ball = body(slot);
    noteSpeed(ball.v, ball.radius);
    ball.x += (dt / 2) * ball.v;
    ball.v += dt * gravity_;
    acceleration(slot) = gravity_;
  }
  for (const Contact& contact : contacts_) push(contact, contact.load);
  const double enough = kLoadAccuracy * dt * std::sqrt(dot(gravity_, gravity_));
  double change = 2 * enough;
  for (int sweep = 0; sweep < kMostLoadSweeps && change > enough; ++sweep) {
    change = 0;
    for (Contact& contact : contacts_) {
      if (!contact.resting) continue;
      const double closing = contact.gap > 0 ? contact.gap / dt : 0;  // fills the gap and no more
      change = std::max(change, pressApart(contact, -closing));
    }
  }
  for (const Contact& contact : contacts_) {
    pairs()[contact.pair].impulse = contact.load;
    if (contact.load == 0) continue;
    const Vector3 pull = (contact.load / dt) * contact.normal;
    acceleration(contact.a) -= contact.w_a * pull;
    if (contact.w_b > 0) acceleration(contact.b) += contact.w_b * pull;
  }
  wakeWhereLoadsChanged();
  for (const Slot slot : movers()) {
    SteppedBall& ball = body(slot);
    noteSpeed(ball.v, ball.radius);
    ball.x += (dt / 2) * ball.v;
  }
}

// Changes the load so that the contact parts at the speed wanted, or faster and bears nothing.
// Returns the change of that speed, m/s.
double Discrete::pressApart(Contact& contact, double wanted) {
  const double w = contact.w_a + contact.w_b;
  const double lacking = wanted - separationSpeed(contact);
  const double load = std::max(0.0, contact.load + kOverrelaxation * lacking / w);
  const double change = load - contact.load;
  contact.load = load;
  if (change != 0) push(contact, change);
  return std::abs(change) * w;
}

double Discrete::separationSpeed(const Contact& contact) const {
  const double of_a = dot(body(contact.a).v, contact.normal);
  return contact.w_b > 0 ? dot(body(contact.b).v, contact.normal) - of_a : -of_a;
}

void Discrete::push(const Contact& contact, double impulse) {
  body(contact.a).v -= (contact.w_a * impulse) * contact.normal;
  if (contact.w_b > 0) body(contact.b).v += (contact.w_b * impulse) * contact.normal;
}

// --- contacts

void Discrete::findContacts() {
  contacts_.clear();
  Contact contact;
  for (std::uint32_t i = 0; i < pairs().size(); ++i) {
    NearPair& pair = pairs()[i];
    if (!findContact(pair, contact)) {
      if (pair.touching) wakeIfUnloaded(pair);
      pair.touching = false;
      continue;
    }
    if (!pair.touching) pair.impulse = pair.reference = 0;
    contact.pair = i;
    contact.a = pair.a;
    contact.b = pair.b;
    contact.load = pair.impulse;
    contact.w_a = body(pair.a).w;
    contact.w_b = mobility(pair.b);
    pair.touching = true;
    counts().deepest_overlap = std::max(counts().deepest_overlap, -contact.gap);
    contacts_.push_back(contact);
  }
}

// Whether a pair touches, or may within a step; then where.
bool Discrete::findContact(const NearPair& pair, Contact& contact) const {
  const SteppedBall& a = body(pair.a);
  if (isWithWall(pair)) {
    const Wall<double>& wall = wallOf(pair);
    contact.gap = dot(a.x, wall.normal) - wall.offset - a.radius;
    contact.normal = -wall.normal;
    return contact.gap <= margin();
  }
  const SteppedBall& b = body(pair.b);
  const Vector3 between = near().between(pair, a, b);
  const double reach = a.radius + b.radius;
  const double within = reach + margin();
  const double squared = dot(between, between);
  if (squared > within * within) return false;
  contact.gap = std::sqrt(squared) - reach;
  contact.normal = contactNormal<double>(between);
  return true;
}

void Discrete::resolveImpacts() {
  bool again = !contacts_.empty();
  for (int sweep = 0; sweep < kMostImpactSweeps && again; ++sweep) {
    again = false;
    for (Contact& contact : contacts_) {
      if (contact.gap <= 0 && resolveImpact(contact)) again = true;
    }
  }
}

// Applies the collision law if the contact approaches, and faster than what rests.
bool Discrete::resolveImpact(Contact& contact) {
  if (-separationSpeed(contact) <= resting_speed_) return false;
  if (standsAsleep(contact.b)) wake(contact.b);
  contact.w_b = mobility(contact.b);
  const NearPair& pair = pairs()[contact.pair];
  SteppedBall& a = body(contact.a);
  double impulse = 0;
  double speed = 0;
  if (isWithWall(pair)) {
    speed = collideWithWall<double>(a.v, wallOf(pair).normal, restitution_);
    impulse = (1 + restitution_) * speed / a.w;
    ++counts().wall_collisions;
  } else {
    SteppedBall& b = body(contact.b);
    const Exchange<double> passed =
        collide<double>(a.v, contact.w_a, b.v, contact.w_b, contact.normal, restitution_);
    speed = passed.approach_speed;
    impulse = passed.impulse;
    ++counts().ball_collisions;
    counts().virial += impulse * (a.radius + b.radius + contact.gap);
  }
  report(pair, contact.normal, impulse, speed);
  return true;
}

void Discrete::markResting() {
  for (Contact& contact : contacts_) {
    contact.resting = std::abs(separationSpeed(contact)) <= resting_speed_;
    if (!contact.resting) contact.load = 0;
  }
}

// Moves balls out of the overlap of resting contacts. No velocity changes.
void Discrete::separate() {
  double moved = 0;
  for (int sweep = 0; sweep < kSeparationSweeps; ++sweep) {
    double farthest = 0;
    for (Contact& contact : contacts_) {
      if (!contact.resting || !findContact(pairs()[contact.pair], contact)) continue;
      SteppedBall& a = body(contact.a);
      const double overlap = -contact.gap - kLeftOverlap * a.radius;
      if (overlap <= 0) continue;
      const double w = contact.w_a + contact.w_b;
      const Vector3 way = (kSeparationShare * overlap) * contact.normal;
      a.x -= (contact.w_a / w) * way;
      if (contact.w_b > 0) body(contact.b).x += (contact.w_b / w) * way;
      farthest = std::max(farthest, kSeparationShare * overlap);
    }
    if (farthest == 0) break;
    moved += farthest;
  }
  near().noteMove(moved);
}

// --- sleep

// Reciprocal of the mass that a contact sees in a partner, 1/kg.
double Discrete::mobility(std::uint32_t partner) const {
  return partner >= kFirstWall || isAsleep(partner) ? 0 : body(partner).w;
}

bool Discrete::standsAsleep(std::uint32_t partner) const {
  return partner < kFirstWall && isAsleep(partner);
}

void Discrete::wake(Slot slot) {
  watch_.restart(slot);
  if (isAsleep(slot)) setAsleep(slot, false);
}

void Discrete::wakeWhereLoadsChanged() {
  const double weight = dot(gravity_, gravity_) * timeStep() * timeStep();
  for (const Contact& contact : contacts_) {
    if (!standsAsleep(contact.b)) continue;
    const double before = pairs()[contact.pair].reference;
    const double least = kWeightChange * std::sqrt(weight) / body(contact.b).w;
    if (std::abs(contact.load - before) > kLoadChange * before + least) wake(contact.b);
  }
}

// A contact has opened: what bore a sleeping ball, or what it bore, is gone.
void Discrete::wakeIfUnloaded(const NearPair& pair) {
  if (standsAsleep(pair.b) && pair.reference > 0) wake(pair.b);
}

void Discrete::noteLateRest() {
  for (const Contact& contact : contacts_) {
    if (contact.load == 0 || isWithWall(pairs()[contact.pair])) continue;
    const double radius = std::min(body(contact.a).radius, body(contact.b).radius);
    if (radius < rests_late_below_) smallest_late_ = std::min(smallest_late_, radius);
  }
}

void Discrete::fallAsleep() {
  bool any = false;
  for (const Slot slot : movers()) {
    drowsy_[slot] = watch_.look(slot, body(slot)) ? 1 : 0;
    any = any || drowsy_[slot] != 0;
  }
  if (!any) return;
  keepAwakeOnMovingSupports();
  for (const Slot slot : movers()) {
    if (drowsy_[slot] == 0) continue;
    body(slot).v = Vector3::Zero();
    acceleration(slot) = Vector3::Zero();
    setAsleep(slot, true);
  }
  for (const Contact& contact : contacts_) {
    NearPair& pair = pairs()[contact.pair];
    const bool fell = drowsy_[pair.a] != 0 || (contact.w_b > 0 && drowsy_[pair.b] != 0);
    if (fell) pair.reference = pair.impulse;
  }
}

// A ball that sleeps leaves its weight to what bears it, so that has to sleep as well.
void Discrete::keepAwakeOnMovingSupports() {
  const double level = kBeside * std::sqrt(dot(gravity_, gravity_));
  bool again = true;
  while (again) {
    again = false;
    for (const Contact& contact : contacts_) {
      if (contact.load == 0 || contact.w_b == 0) continue;
      const double down = dot(contact.normal, gravity_);  // > 0: b is below a
      if (drowsy_[contact.a] != 0 && drowsy_[contact.b] == 0 && down > level) {
        drowsy_[contact.a] = 0;
        again = true;
      }
      if (drowsy_[contact.b] != 0 && drowsy_[contact.a] == 0 && -down > level) {
        drowsy_[contact.b] = 0;
        again = true;
      }
    }
  }
}

// --- what there is to know

Statistics Discrete::statistics() const {
  Statistics statistics = SteppedMethod::statistics();
  statistics.bytes += contacts_.capacity() * sizeof(Contact) + drowsy_.capacity() + watch_.bytes();
  return statistics;
}

std::string Discrete::warning() const {
  const std::string far = warningOfFarMoves();
  if (std::isinf(smallest_late_)) return far;
  const double g = std::sqrt(dot(gravity_, gravity_));
  const std::string late = "discrete: balls of radius " + formatShort(smallest_late_) +
                           " m that lie on others come to rest late at a time_step of " +
                           formatShort(timeStep()) + " s; take one of " +
                           formatShort(kLongestRestingStep * std::sqrt(smallest_late_ / g)) +
                           " s or less";
  return far.empty() ? late : far + "; " + late;
}

std::unique_ptr<Method> makeDiscrete(const Surroundings& surroundings,
                                     const MethodSettings& settings) {
  return std::make_unique<Discrete>(surroundings, settings.time_step);
}

}  // namespace ball_sim::core
