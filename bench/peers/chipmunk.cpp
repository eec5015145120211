// Chipmunk2D 7 (chipmunk-physics.net), planar, double precision.
//
// Settings: 10 iterations (the default); elasticity as the product of two, so each gets its root;
// collision slop 0, as the default of 0.1 m is a game's; overlap is taken out by a bias that gives
// no speed (cpSpaceSetCollisionBias, default). No rotation. Walls are segments 20 m thick.
#include <chipmunk/chipmunk.h>

#include <cmath>

#include "ball_sim/walls.hpp"
#include "peer.hpp"

namespace ball_sim::core::chart {
namespace {

constexpr double kThickness = 20;  // m
constexpr double kLength = 1000;   // m

cpVect toChipmunk(const Vector3& v) { return cpv(v.x(), v.y()); }
Vector3 fromChipmunk(const cpVect& v) { return {v.x, v.y, 0}; }

// The numbers of balls and walls travel as pointers.
cpDataPointer asData(Partner partner) { return reinterpret_cast<cpDataPointer>(partner); }
Partner fromData(const cpShape* shape) {
  return reinterpret_cast<Partner>(cpShapeGetUserData(shape));
}

class Chipmunk final : public Peer {
 public:
  Chipmunk(const Surroundings& surroundings, const std::vector<Ball>& balls, double step)
      : space_(cpSpaceNew()), root_(std::sqrt(surroundings.restitution)), step_(step) {
    cpSpaceSetIterations(space_, 10);
    cpSpaceSetGravity(space_, toChipmunk(surroundings.gravity));
    cpSpaceSetCollisionSlop(space_, 0);
    cpCollisionHandler* handler = cpSpaceAddDefaultCollisionHandler(space_);
    handler->postSolveFunc = &Chipmunk::afterSolving;
    handler->userData = this;
    for (const Wall<double>& wall : wallsOf<double>(surroundings)) addWall(wall);
    for (std::size_t i = 0; i < balls.size(); ++i) addBall(balls[i], static_cast<Partner>(i));
  }

  ~Chipmunk() override {
    for (cpShape* shape : shapes_) {
      cpSpaceRemoveShape(space_, shape);
      cpShapeFree(shape);
    }
    for (cpBody* body : balls_) {
      cpSpaceRemoveBody(space_, body);
      cpBodyFree(body);
    }
    cpSpaceFree(space_);
  }
  Chipmunk(const Chipmunk&) = delete;
  Chipmunk& operator=(const Chipmunk&) = delete;

  void advance(std::uint64_t steps) override {
    for (std::uint64_t i = 0; i < steps; ++i) {
      touching_.clear();
      cpSpaceStep(space_, step_);
    }
  }

  void read(BallStates& states) override {
    resize(states, balls_.size());
    for (std::size_t i = 0; i < balls_.size(); ++i) {
      states.positions[i] = fromChipmunk(cpBodyGetPosition(balls_[i]));
      states.velocities[i] = fromChipmunk(cpBodyGetVelocity(balls_[i]));
    }
  }

  void touching(std::vector<Impact>& pairs) override {
    pairs.insert(pairs.end(), touching_.begin(), touching_.end());
  }

 private:
  static void afterSolving(cpArbiter* arbiter, cpSpace* /*space*/, cpDataPointer self) {
    cpShape* first = nullptr;
    cpShape* second = nullptr;
    cpArbiterGetShapes(arbiter, &first, &second);
    const Partner a = fromData(first);
    const Partner b = fromData(second);
    static_cast<Chipmunk*>(self)->touching_.push_back(a >= 0 ? impactOf(static_cast<BallId>(a), b)
                                                             : impactOf(static_cast<BallId>(b), a));
  }

  void addShape(cpShape* shape, Partner partner) {
    cpShapeSetElasticity(shape, root_);
    cpShapeSetFriction(shape, 0);
    cpShapeSetUserData(shape, asData(partner));
    shapes_.push_back(cpSpaceAddShape(space_, shape));
  }

  void addWall(const Wall<double>& wall) {
    const Vector3 centre = (wall.offset - kThickness) * wall.normal;
    const Vector3 along = kLength / 2 * Vector3(-wall.normal.y(), wall.normal.x(), 0);
    addShape(cpSegmentShapeNew(cpSpaceGetStaticBody(space_), toChipmunk(centre - along),
                               toChipmunk(centre + along), kThickness),
             wall.partner);
  }

  void addBall(const Ball& ball, Partner index) {
    cpBody* body = cpSpaceAddBody(space_, cpBodyNew(ball.mass, INFINITY));
    cpBodySetPosition(body, toChipmunk(ball.position));
    cpBodySetVelocity(body, toChipmunk(ball.velocity));
    addShape(cpCircleShapeNew(body, ball.radius, cpvzero), index);
    balls_.push_back(body);
  }

  cpSpace* space_;
  std::vector<cpBody*> balls_;
  std::vector<cpShape*> shapes_;
  std::vector<Impact> touching_;
  double root_;  // of the restitution
  double step_;  // s
};

}  // namespace

std::unique_ptr<Peer> makeChipmunk(const Surroundings& surroundings, const std::vector<Ball>& balls,
                                   double step) {
  return std::make_unique<Chipmunk>(surroundings, balls, step);
}

}  // namespace ball_sim::core::chart
