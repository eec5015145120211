// Open Dynamics Engine 0.16 (ode.org), double precision.
//
// Settings: QuickStep with 20 iterations (the default; the direct solver multiplies the energy of a
// cradle); CFM 0, so that contacts are hard; bounce_vel 0; one contact a pair. ERP, which drives
// overlapping balls apart and gives them speed by it, is 0 where restitution is 1, as there every
// contact ends by itself, and 0.2 (the default) elsewhere. Source: ODE manual, "Contact" and
// "How to use ERP and CFM".
#include <ode/ode.h>

#include <algorithm>
#include <cmath>

#include "ball_sim/walls.hpp"
#include "peer.hpp"

namespace ball_sim::core::chart {
namespace {

// The numbers of balls and walls travel as pointers, counted from a base.
void* asData(Partner partner) { return reinterpret_cast<void*>(partner); }
Partner fromData(dGeomID geom) { return reinterpret_cast<Partner>(dGeomGetData(geom)); }

Vector3 fromOde(const dReal* v) { return {v[0], v[1], v[2]}; }

class Ode final : public Peer {
 public:
  Ode(const Surroundings& surroundings, const std::vector<Ball>& balls, double step)
      : step_(step), restitution_(surroundings.restitution) {
    dInitODE2(0);
    world_ = dWorldCreate();
    space_ = dHashSpaceCreate(nullptr);
    group_ = dJointGroupCreate(0);
    const Vector3& g = surroundings.gravity;
    dWorldSetGravity(world_, g.x(), g.y(), g.z());
    dWorldSetCFM(world_, 0);
    dWorldSetERP(world_, erp());
    dWorldSetAutoDisableFlag(world_, 0);
    dWorldSetQuickStepNumIterations(world_, 20);
    setCells(balls);
    for (const Wall<double>& wall : wallsOf<double>(surroundings)) {
      const Vector3& n = wall.normal;
      dGeomSetData(dCreatePlane(space_, n.x(), n.y(), n.z(), wall.offset), asData(wall.partner));
    }
    for (std::size_t i = 0; i < balls.size(); ++i) add(balls[i], static_cast<Partner>(i));
  }

  ~Ode() override {
    dJointGroupDestroy(group_);
    dSpaceDestroy(space_);
    dWorldDestroy(world_);
    dCloseODE();
  }
  Ode(const Ode&) = delete;
  Ode& operator=(const Ode&) = delete;

  void advance(std::uint64_t steps) override {
    for (std::uint64_t i = 0; i < steps; ++i) step();
  }

  void read(BallStates& states) override {
    resize(states, bodies_.size());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      states.positions[i] = fromOde(dBodyGetPosition(bodies_[i]));
      states.velocities[i] = fromOde(dBodyGetLinearVel(bodies_[i]));
    }
  }

  void touching(std::vector<Impact>& pairs) override {
    pairs.insert(pairs.end(), touching_.begin(), touching_.end());
  }

 private:
  void step() {
    touching_.clear();
    dSpaceCollide(space_, this, &Ode::near);
    dWorldQuickStep(world_, step_);
    dJointGroupEmpty(group_);
  }

  double erp() const { return restitution_ < 1 ? 0.2 : 0; }

  // Cells from the smallest ball's size to the largest's.
  void setCells(const std::vector<Ball>& balls) {
    double smallest = balls[0].radius;
    double largest = smallest;
    for (const Ball& ball : balls) {
      smallest = std::min(smallest, ball.radius);
      largest = std::max(largest, ball.radius);
    }
    dHashSpaceSetLevels(space_, std::ilogb(2 * smallest), std::ilogb(2 * largest) + 1);
  }

  void add(const Ball& ball, Partner index) {
    const dBodyID body = dBodyCreate(world_);
    dMass mass;
    dMassSetSphereTotal(&mass, ball.mass, ball.radius);
    dBodySetMass(body, &mass);
    dBodySetPosition(body, ball.position.x(), ball.position.y(), ball.position.z());
    dBodySetLinearVel(body, ball.velocity.x(), ball.velocity.y(), ball.velocity.z());
    const dGeomID geom = dCreateSphere(space_, ball.radius);
    dGeomSetBody(geom, body);
    dGeomSetData(geom, asData(index));
    bodies_.push_back(body);
  }

  static void near(void* self, dGeomID a, dGeomID b) { static_cast<Ode*>(self)->meet(a, b); }

  void meet(dGeomID a, dGeomID b) {
    if (dGeomGetBody(a) == nullptr && dGeomGetBody(b) == nullptr) return;
    dContact contact{};
    if (dCollide(a, b, 1, &contact.geom, sizeof contact) == 0) return;
    contact.surface.mode = dContactBounce | dContactSoftERP | dContactSoftCFM;
    contact.surface.mu = 0;
    contact.surface.bounce = restitution_;
    contact.surface.bounce_vel = 0;
    contact.surface.soft_erp = erp();
    contact.surface.soft_cfm = 0;
    dJointAttach(dJointCreateContact(world_, group_, &contact), dGeomGetBody(a), dGeomGetBody(b));
    const Partner first = fromData(a);
    const Partner second = fromData(b);
    touching_.push_back(first >= 0 ? impactOf(static_cast<BallId>(first), second)
                                   : impactOf(static_cast<BallId>(second), first));
  }

  dWorldID world_;
  dSpaceID space_;
  dJointGroupID group_;
  std::vector<dBodyID> bodies_;
  std::vector<Impact> touching_;
  double step_;  // s
  double restitution_;
};

}  // namespace

std::unique_ptr<Peer> makeOde(const Surroundings& surroundings, const std::vector<Ball>& balls,
                              double step) {
  return std::make_unique<Ode>(surroundings, balls, step);
}

}  // namespace ball_sim::core::chart
