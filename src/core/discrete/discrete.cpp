// Method discrete.
#include "discrete/discrete.hpp"

#include <algorithm>
#include <cmath>

#include "ball_sim/collision_law.hpp"
#include "ball_sim/text.hpp"

namespace ball_sim::core {
namespace {

// Contacts slower than what gravity gives in so many steps rest: a bounce that begins at this speed
// with e = 1 lasts four steps, and fewer are not a parabola.
constexpr double kRestingSteps = 2;

// The loads of a pile change little from step to step; these sweeps settle what did change.
constexpr int kMostLoadSweeps = 40;
constexpr double kLoadAccuracy = 1e-4;  // of the speed that gravity gives in a step

// A chain of touching balls passes an impulse on in one sweep when it runs up the ids, in as many
// as it is long when it runs down. What is left goes on in the next step.
constexpr int kMostImpactSweeps = 32;

// Overlap of resting contacts is taken away bit by bit, so that neighbours do not fight.
constexpr int kSeparationSweeps = 4;
constexpr double kSeparationShare = 0.3;
constexpr double kLeastOverlap = 1e-9;  // of the radius: less is left alone

constexpr double kFarthestMove = 0.5;  // radii in a step; further, and one impact in 200 is missed

}  // namespace

Discrete::Discrete(const Surroundings& surroundings, double time_step)
    : SteppedMethod(surroundings, time_step),
      gravity_(surroundings.gravity),
      restitution_(surroundings.restitution) {
  const double gained = std::sqrt(dot(gravity_, gravity_)) * time_step;  // m/s in a step
  resting_speed_ = restitution_ < 1 ? kRestingSteps * gained : 0;
  setMargin(resting_speed_ > 0 ? gained * time_step : 0);
}

void Discrete::step() {
  fastest_squared_ = 0;
  if (resting_speed_ > 0) {
    fallAndRest();
  } else {
    fall();
  }
  updatePairs(std::sqrt(fastest_squared_));
  findContacts();
  resolveImpacts();
  if (resting_speed_ > 0) {
    markResting();
    separate();
  }
}

void Discrete::ballsChanged() {
  const auto changed = [this](const Contact& contact) {
    return isNew(contact.a) || (contact.b < kFirstWall && isNew(contact.b));
  };
  contacts_.erase(std::remove_if(contacts_.begin(), contacts_.end(), changed), contacts_.end());
}

// --- motion

void Discrete::noteSpeed(const SteppedBall& ball) {
  const double squared = dot(ball.v, ball.v);
  fastest_squared_ = std::max(fastest_squared_, squared);
  const double far = kFarthestMove * ball.radius / timeStep();  // m/s
  if (squared > far * far) {
    farthest_ = std::max(farthest_, std::sqrt(squared) * timeStep() / ball.radius);
  }
}

void Discrete::fall() {
  const double dt = timeStep();
  for (const Slot slot : movers()) {
    SteppedBall& ball = body(slot);
    noteSpeed(ball);
    ball.x += dt * (ball.v + (dt / 2) * gravity_);
    ball.v += dt * gravity_;
    noteSpeed(ball);
  }
}

// Half the way with the velocity before, half with that after gravity and contacts: exact for balls
// that touch nothing, and no way at all for balls that rest.
void Discrete::fallAndRest() {
  const double dt = timeStep();
  for (const Slot slot : movers()) {
    SteppedBall& ball = body(slot);
    noteSpeed(ball);
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
  for (const Slot slot : movers()) {
    SteppedBall& ball = body(slot);
    noteSpeed(ball);
    ball.x += (dt / 2) * ball.v;
  }
}

// Changes the load so that the contact parts at least at the speed wanted, if it bears anything.
// Returns the change of that speed, m/s.
double Discrete::pressApart(Contact& contact, double wanted) {
  const double w = contact.w_a + contact.w_b;
  const double lacking = wanted - separationSpeed(contact);
  const double load = std::max(0.0, contact.load + lacking / w);
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
      pair.touching = false;
      continue;
    }
    contact.pair = i;
    contact.a = pair.a;
    contact.b = pair.b;
    contact.load = pair.touching ? pair.impulse : 0;
    contact.w_a = body(pair.a).w;
    contact.w_b = isWithWall(pair) ? 0 : body(pair.b).w;
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
    for (const Contact& contact : contacts_) {
      if (contact.gap <= 0 && resolveImpact(contact)) again = true;
    }
  }
}

// Applies the collision law if the contact approaches, and faster than what rests.
bool Discrete::resolveImpact(const Contact& contact) {
  if (-separationSpeed(contact) <= resting_speed_) return false;
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
      if (contact.gap >= -kLeastOverlap * a.radius) continue;
      const double w = contact.w_a + contact.w_b;
      const Vector3 way = (-kSeparationShare * contact.gap) * contact.normal;
      a.x -= (contact.w_a / w) * way;
      if (contact.w_b > 0) body(contact.b).x += (contact.w_b / w) * way;
      farthest = std::max(farthest, -kSeparationShare * contact.gap);
    }
    if (farthest == 0) break;
    moved += farthest;
  }
  near().noteMove(moved);
}

// --- what there is to know

Statistics Discrete::statistics() const {
  Statistics statistics = SteppedMethod::statistics();
  statistics.bytes += contacts_.capacity() * sizeof(Contact);
  return statistics;
}

std::string Discrete::warning() const {
  if (farthest_ == 0) return {};
  return "discrete: a ball moved by " + formatNumber(farthest_) +
         " of its radius in one time_step of " + formatNumber(timeStep()) + " s: beyond " +
         formatNumber(kFarthestMove) +
         " balls pass through each other unseen; take a shorter time_step or method event_driven";
}

std::unique_ptr<Method> makeDiscrete(const Surroundings& surroundings,
                                     const MethodSettings& settings) {
  return std::make_unique<Discrete>(surroundings, settings.time_step);
}

}  // namespace ball_sim::core
