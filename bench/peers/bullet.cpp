// Bullet 3 (bulletphysics.org), double precision.
//
// Settings: sequential impulses, 10 iterations (the default); restitution as the product of two, so
// each gets its root; m_restitutionVelocityThreshold 0, as below it Bullet does not bounce at all
// (bullet3 #1530), but under gravity its default of 0.2 m/s, which lets balls come to rest; split
// impulse for every depth, which moves overlapping balls apart without giving them speed
// (btContactSolverInfo.h); contacts only where balls touch (setContactProcessingThreshold), as
// those ahead of time take energy from a bounce. No continuous detection: it stops a ball at its
// impact and halves the energy of a head-on hit.
#define BT_USE_DOUBLE_PRECISION
#include <btBulletDynamicsCommon.h>

#include <cmath>

#include "ball_sim/walls.hpp"
#include "peer.hpp"

namespace ball_sim::core::chart {
namespace {

btVector3 toBullet(const Vector3& v) { return {v.x(), v.y(), v.z()}; }
Vector3 fromBullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }

class Bullet final : public Peer {
 public:
  Bullet(const Surroundings& surroundings, const std::vector<Ball>& balls, double step)
      : dispatcher_(&configuration_),
        world_(&dispatcher_, &broadphase_, &solver_, &configuration_),
        root_(std::sqrt(surroundings.restitution)),
        step_(step) {
    world_.setGravity(toBullet(surroundings.gravity));
    btContactSolverInfo& info = world_.getSolverInfo();
    if (surroundings.gravity == Vector3::Zero()) info.m_restitutionVelocityThreshold = 0;
    info.m_splitImpulse = 1;
    info.m_splitImpulsePenetrationThreshold = 0;
    info.m_numIterations = 10;
    for (const Wall<double>& wall : wallsOf<double>(surroundings)) {
      auto shape = std::make_unique<btStaticPlaneShape>(toBullet(wall.normal), wall.offset);
      add(std::move(shape), 0, btVector3(0, 0, 0), static_cast<int>(wall.partner));
    }
    for (std::size_t i = 0; i < balls.size(); ++i) {
      auto shape = std::make_unique<btSphereShape>(balls[i].radius);
      btRigidBody& body = add(std::move(shape), std::isinf(balls[i].mass) ? 0 : balls[i].mass,
                              toBullet(balls[i].position), static_cast<int>(i));
      body.setLinearVelocity(toBullet(balls[i].velocity));
      balls_.push_back(&body);
    }
  }

  ~Bullet() override {
    for (const auto& body : bodies_) world_.removeRigidBody(body.get());
  }
  Bullet(const Bullet&) = delete;
  Bullet& operator=(const Bullet&) = delete;

  void advance(std::uint64_t steps) override {
    for (std::uint64_t i = 0; i < steps; ++i) world_.stepSimulation(step_, 0);
  }

  void read(BallStates& states) override {
    resize(states, balls_.size());
    for (std::size_t i = 0; i < balls_.size(); ++i) {
      states.positions[i] = fromBullet(balls_[i]->getWorldTransform().getOrigin());
      states.velocities[i] = fromBullet(balls_[i]->getLinearVelocity());
    }
  }

  void touching(std::vector<Impact>& pairs) override {
    for (int i = 0; i < dispatcher_.getNumManifolds(); ++i) {
      const btPersistentManifold* manifold = dispatcher_.getManifoldByIndexInternal(i);
      for (int j = 0; j < manifold->getNumContacts(); ++j) {
        if (!(manifold->getContactPoint(j).getAppliedImpulse() > 0)) continue;
        const int a = manifold->getBody0()->getUserIndex();
        const int b = manifold->getBody1()->getUserIndex();
        pairs.push_back(a >= 0 ? impactOf(static_cast<BallId>(a), b)
                               : impactOf(static_cast<BallId>(b), a));
      }
    }
  }

 private:
  btRigidBody& add(std::unique_ptr<btCollisionShape> shape, double mass, const btVector3& position,
                   int index) {
    btVector3 inertia(0, 0, 0);
    if (mass > 0) shape->calculateLocalInertia(mass, inertia);
    btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, shape.get(), inertia);
    info.m_startWorldTransform.setIdentity();
    info.m_startWorldTransform.setOrigin(position);
    info.m_restitution = root_;
    info.m_friction = 0;
    info.m_linearDamping = 0;
    info.m_angularDamping = 0;
    bodies_.push_back(std::make_unique<btRigidBody>(info));
    shapes_.push_back(std::move(shape));
    btRigidBody& body = *bodies_.back();
    body.setUserIndex(index);
    body.setActivationState(DISABLE_DEACTIVATION);
    body.setContactProcessingThreshold(0);
    world_.addRigidBody(&body);
    return body;
  }

  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDbvtBroadphase broadphase_;
  btSequentialImpulseConstraintSolver solver_;
  btDiscreteDynamicsWorld world_;
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btRigidBody>> bodies_;
  std::vector<btRigidBody*> balls_;
  double root_;  // of the restitution
  double step_;  // s
};

}  // namespace

std::unique_ptr<Peer> makeBullet(const Surroundings& surroundings, const std::vector<Ball>& balls,
                                 double step) {
  return std::make_unique<Bullet>(surroundings, balls, step);
}

}  // namespace ball_sim::core::chart
