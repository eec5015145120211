// Method soft_sphere.
#include "soft_sphere/soft_sphere.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "ball_sim/collision_law.hpp"
#include "ball_sim/text.hpp"

namespace ball_sim::core {
namespace {

constexpr double kFewestStepsPerContact = 10;  // energy error 2e-3 an impact; fewer are refused

}  // namespace

SoftSphere::SoftSphere(const Surroundings& surroundings, double time_step, double contact_time,
                       double tolerance)
    : SteppedMethod(surroundings, time_step),
      spring_(contactSpring(contact_time, surroundings.restitution)),
      contact_time_(contact_time),
      tolerance_(tolerance) {}

void SoftSphere::step() {
  move();
  updatePairs();
  pullAll();
  for (const Slot slot : movers()) {
    body(slot).v += (timeStep() / 2) * (accelerations_[slot] - acceleration(slot));
    acceleration(slot) = accelerations_[slot];
  }
}

// Places at the end of the step, and velocities as if the acceleration stayed what it was.
void SoftSphere::move() {
  const double dt = timeStep();
  accelerations_.resize(slotCount());
  forgetSpeeds();
  for (const Slot slot : movers()) {
    SteppedBall& ball = body(slot);
    const Vector3 mean = ball.v + (dt / 2) * acceleration(slot);
    noteSpeed(mean, ball.radius);
    ball.x += dt * mean;
    ball.v += dt * acceleration(slot);
    accelerations_[slot] = surroundings().gravity;
  }
}

void SoftSphere::pullAll() {
  Contact contact;
  for (NearPair& pair : pairs()) {
    if (findContact(pair, contact)) {
      pull(pair, contact);
    } else if (pair.touching) {
      noteEnd(pair);
    }
  }
}

bool SoftSphere::findContact(const NearPair& pair, Contact& contact) const {
  const SteppedBall& a = body(pair.a);
  if (isWithWall(pair)) {
    const Wall<double>& wall = wallOf(pair);
    contact.distance = dot(a.x, wall.normal) - wall.offset;
    contact.overlap = a.radius - contact.distance;
    contact.normal = -wall.normal;
    return contact.overlap > 0;
  }
  const SteppedBall& b = body(pair.b);
  const Vector3 between = near().between(pair, a, b);
  const double reach = a.radius + b.radius;
  const double squared = dot(between, between);
  if (squared >= reach * reach) return false;
  contact.distance = std::sqrt(squared);
  contact.overlap = reach - contact.distance;
  contact.normal = contactNormal<double>(between);
  return true;
}

void SoftSphere::pull(NearPair& pair, const Contact& contact) {
  const bool with_ball = !isWithWall(pair);
  const double speed = approachSpeed(pair, contact.normal);
  if (!pair.touching) noteBegin(pair, speed);
  const double force =
      (spring_.stiffness * contact.overlap + spring_.damping * speed) / inverseMass(pair);
  accelerations_[pair.a] -= (body(pair.a).w * force) * contact.normal;
  double radius = body(pair.a).radius;
  if (with_ball) {
    const SteppedBall& b = body(pair.b);
    if (b.w > 0) accelerations_[pair.b] += (b.w * force) * contact.normal;
    radius = std::min(radius, b.radius);
    counts().virial += force * timeStep() * contact.distance;
  }
  pair.impulse += force * timeStep();
  counts().deepest_overlap = std::max(counts().deepest_overlap, contact.overlap);
  deepest_ = std::max(deepest_, contact.overlap / radius);
}

void SoftSphere::noteBegin(NearPair& pair, double approach_speed) {
  pair.touching = true;
  pair.impulse = 0;
  pair.reference = std::max(0.0, approach_speed);
  ++(isWithWall(pair) ? counts().wall_collisions : counts().ball_collisions);
}

// A contact is logged when it ends: then its impulse is known.
void SoftSphere::noteEnd(NearPair& pair) {
  pair.touching = false;
  const Vector3 normal =
      isWithWall(pair) ? Vector3(-wallOf(pair).normal)
                       : contactNormal<double>(near().between(pair, body(pair.a), body(pair.b)));
  report(pair, normal, std::max(0.0, pair.impulse), pair.reference);
}

// Reciprocal of the reduced mass, 1/kg.
double SoftSphere::inverseMass(const NearPair& pair) const {
  return body(pair.a).w + (isWithWall(pair) ? 0 : body(pair.b).w);
}

double SoftSphere::approachSpeed(const NearPair& pair, const Vector3& normal) const {
  const double of_a = dot(body(pair.a).v, normal);
  return isWithWall(pair) ? of_a : of_a - dot(body(pair.b).v, normal);
}

Statistics SoftSphere::statistics() const {
  Statistics statistics = SteppedMethod::statistics();
  statistics.bytes += accelerations_.capacity() * sizeof(Vector3);
  Contact contact;
  for (const NearPair& pair : pairs()) {
    if (!pair.touching || !findContact(pair, contact)) continue;
    statistics.elastic_energy +=
        spring_.stiffness / inverseMass(pair) * contact.overlap * contact.overlap / 2;
  }
  return statistics;
}

std::string SoftSphere::warning() const {
  const std::string far = warningOfFarMoves();
  if (deepest_ <= tolerance_) return far;
  const std::string deep =
      "soft_sphere: balls overlapped by " + formatShort(deepest_) +
      " of a radius, more than the tolerance of " + formatNumber(tolerance_) +
      (deepest_ >= 1 ? ", and went through walls or each other" : "") + ", in contacts of " +
      formatShort(contact_time_) +
      " s: take a shorter time_step, and a tolerance that fits it, or method event_driven";
  return far.empty() ? deep : deep + "; " + far;
}

std::unique_ptr<Method> makeSoftSphere(const Surroundings& surroundings,
                                       const MethodSettings& settings) {
  const double contact_time =
      settings.contact_time.value_or(kUsualStepsPerContact * settings.time_step);
  const double longest = contact_time / kFewestStepsPerContact;
  // The slack lets in a tenth that was rounded.
  if (!(settings.time_step <= longest * (1 + 1e-12))) {
    throw std::invalid_argument(
        "time_step: " + formatNumber(settings.time_step) +
        ": soft_sphere needs at most a tenth of the contact time, " + formatNumber(longest) +
        " s, to keep the energy of an impact; without a time_step a scene gets one that "
        "fits");
  }
  return std::make_unique<SoftSphere>(surroundings, settings.time_step, contact_time,
                                      settings.tolerance.value_or(kUsualOverlap));
}

}  // namespace ball_sim::core
