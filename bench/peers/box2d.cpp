// Box2D 2.4 (box2d.org), planar, single precision (it has no other).
//
// Settings: 8 velocity and 3 position iterations (the manual's advice); restitutionThreshold 0, but
// under gravity its default of 1 m/s, without which a stack jumps apart; continuous detection
// against walls on (the default), among balls off: a "bullet" costs tenfold and gains nothing at
// these speeds. Built-in limits stay: no ball goes further than 2 m a step (b2_maxTranslation).
// Walls are boxes 20 m thick.
#include <box2d/box2d.h>

#include <cmath>

#include "ball_sim/walls.hpp"
#include "peer.hpp"

namespace ball_sim::core::chart {
namespace {

constexpr float kThickness = 20;  // m
constexpr float kLength = 1000;   // m
constexpr float kThreshold = 1;   // m/s, b2FixtureDef's default of restitutionThreshold

b2Vec2 toBox2d(const Vector3& v) { return {static_cast<float>(v.x()), static_cast<float>(v.y())}; }
Vector3 fromBox2d(const b2Vec2& v) { return {double(v.x), double(v.y), 0}; }

class Box2d final : public Peer {
 public:
  Box2d(const Surroundings& surroundings, const std::vector<Ball>& balls, double step)
      : world_(toBox2d(surroundings.gravity)),
        restitution_(static_cast<float>(surroundings.restitution)),
        threshold_(surroundings.gravity == Vector3::Zero() ? 0 : kThreshold),
        step_(static_cast<float>(step)) {
    world_.SetAllowSleeping(false);
    for (const Wall<double>& wall : wallsOf<double>(surroundings)) addWall(wall);
    for (std::size_t i = 0; i < balls.size(); ++i) addBall(balls[i], static_cast<Partner>(i));
  }

  void advance(std::uint64_t steps) override {
    for (std::uint64_t i = 0; i < steps; ++i) world_.Step(step_, 8, 3);
  }

  void read(BallStates& states) override {
    resize(states, balls_.size());
    for (std::size_t i = 0; i < balls_.size(); ++i) {
      states.positions[i] = fromBox2d(balls_[i]->GetPosition());
      states.velocities[i] = fromBox2d(balls_[i]->GetLinearVelocity());
    }
  }

  void touching(std::vector<Impact>& pairs) override {
    for (b2Contact* contact = world_.GetContactList(); contact != nullptr;
         contact = contact->GetNext()) {
      if (!contact->IsTouching()) continue;
      const Partner a = partnerOf(contact->GetFixtureA());
      const Partner b = partnerOf(contact->GetFixtureB());
      pairs.push_back(a >= 0 ? impactOf(static_cast<BallId>(a), b)
                             : impactOf(static_cast<BallId>(b), a));
    }
  }

 private:
  static Partner partnerOf(b2Fixture* fixture) {
    return static_cast<Partner>(static_cast<std::intptr_t>(fixture->GetUserData().pointer));
  }

  void addFixture(b2Body* body, const b2Shape& shape, float density, Partner partner) {
    b2FixtureDef definition;
    definition.shape = &shape;
    definition.density = density;
    definition.friction = 0;
    definition.restitution = restitution_;
    definition.restitutionThreshold = threshold_;
    definition.userData.pointer = static_cast<uintptr_t>(partner);
    body->CreateFixture(&definition);
  }

  void addWall(const Wall<double>& wall) {
    const Vector3 centre = (wall.offset - kThickness / 2) * wall.normal;
    b2PolygonShape box;
    // A quarter turn in single precision would tilt a floor by 4e-8, and a stack on it falls over.
    if (wall.normal.x() == 0) {
      box.SetAsBox(kLength / 2, kThickness / 2, toBox2d(centre), 0);
    } else {
      box.SetAsBox(kThickness / 2, kLength / 2, toBox2d(centre),
                   static_cast<float>(std::atan2(wall.normal.y(), wall.normal.x())));
    }
    b2BodyDef definition;
    addFixture(world_.CreateBody(&definition), box, 0, wall.partner);
  }

  void addBall(const Ball& ball, Partner index) {
    b2BodyDef definition;
    definition.type = b2_dynamicBody;
    definition.position = toBox2d(ball.position);
    definition.linearVelocity = toBox2d(ball.velocity);
    definition.fixedRotation = true;
    b2Body* body = world_.CreateBody(&definition);
    b2CircleShape circle;
    circle.m_radius = static_cast<float>(ball.radius);
    const double area = 3.14159265358979323846 * ball.radius * ball.radius;
    addFixture(body, circle, static_cast<float>(ball.mass / area), index);
    balls_.push_back(body);
  }

  b2World world_;
  std::vector<b2Body*> balls_;
  float restitution_;
  float threshold_;  // m/s, least approach that bounces
  float step_;       // s
};

}  // namespace

std::unique_ptr<Peer> makeBox2d(const Surroundings& surroundings, const std::vector<Ball>& balls,
                                double step) {
  return std::make_unique<Box2d>(surroundings, balls, step);
}

}  // namespace ball_sim::core::chart
