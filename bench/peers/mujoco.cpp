// MuJoCo 2.2 (mujoco.org).
//
// Settings: each ball has three slides and no rotation; contacts without friction (condim 1) that
// are springs, solref = (-stiffness, -damping) (MuJoCo manual, "Solver parameters"): an elastic
// bounce needs damping 0. The stiffness makes a contact last ten steps, the damping follows from
// the restitution: b = -2 ln(e)/t_c. Impedance 0.9999 throughout, so that the spring is as stiff as
// it is said to be. Conjugate gradients to 1e-10, as Newton's
// solver factors a matrix of all balls; semi-implicit Euler.
#include <mujoco/mujoco.h>

#include <cmath>
#include <cstring>
#include <sstream>
#include <stdexcept>

#include "ball_sim/walls.hpp"
#include "peer.hpp"

namespace ball_sim::core::chart {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kContactSteps = 10;

std::string numbers(const Vector3& v) {
  std::ostringstream text;
  text.precision(17);
  text << v.x() << " " << v.y() << " " << v.z();
  return text.str();
}

std::string modelOf(const Surroundings& surroundings, const std::vector<Ball>& balls, double step) {
  const double contact_time = kContactSteps * step;
  const double damping = -2 * std::log(surroundings.restitution) / contact_time;
  const double stiffness = std::pow(kPi / contact_time, 2) + damping * damping / 4;
  const std::size_t most = 10 * balls.size() + 50;  // contacts at one instant
  std::ostringstream text;
  text.precision(17);
  text << "<mujoco><compiler inertiafromgeom='true'/><option timestep='" << step << "' gravity='"
       << numbers(surroundings.gravity)
       << "' solver='CG' iterations='100' tolerance='1e-10' jacobian='sparse'/>"
       << "<size nconmax='" << most << "' njmax='" << most
       << "'/><default><geom condim='1' solref='" << -stiffness << " " << -damping
       << "' solimp='0.9999 0.9999 0.001'/></default><worldbody>";
  for (const Wall<double>& wall : wallsOf<double>(surroundings)) {
    text << "<geom type='plane' size='0 0 1' pos='" << numbers(wall.offset * wall.normal)
         << "' zaxis='" << numbers(wall.normal) << "'/>";
  }
  for (const Ball& ball : balls) {
    text << "<body pos='" << numbers(ball.position) << "'><joint type='slide' axis='1 0 0'/>"
         << "<joint type='slide' axis='0 1 0'/><joint type='slide' axis='0 0 1'/>"
         << "<geom type='sphere' size='" << ball.radius << "' mass='" << ball.mass << "'/></body>";
  }
  text << "</worldbody></mujoco>";
  return text.str();
}

[[noreturn]] void fail(const char* message) { throw std::runtime_error(message); }

class Mujoco final : public Peer {
 public:
  Mujoco(const Surroundings& surroundings, const std::vector<Ball>& balls, double step)
      : starts_(balls.size()) {
    mju_user_error = &fail;
    for (const Wall<double>& wall : wallsOf<double>(surroundings)) {
      walls_.push_back(wall.partner);
    }
    load(modelOf(surroundings, balls, step));
    data_ = mj_makeData(model_);
    for (std::size_t i = 0; i < balls.size(); ++i) {
      starts_[i] = balls[i].position;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        data_->qvel[3 * i + axis] = balls[i].velocity[static_cast<Eigen::Index>(axis)];
      }
    }
  }

  ~Mujoco() override {
    mj_deleteData(data_);
    mj_deleteModel(model_);
  }
  Mujoco(const Mujoco&) = delete;
  Mujoco& operator=(const Mujoco&) = delete;

  void advance(std::uint64_t steps) override {
    for (std::uint64_t i = 0; i < steps; ++i) mj_step(model_, data_);
    for (const mjtWarning warning :
         {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC, mjWARN_CONTACTFULL, mjWARN_CNSTRFULL}) {
      if (data_->warning[warning].number > 0) {
        throw std::runtime_error(mju_warningText(warning, 0));
      }
    }
  }

  void read(BallStates& states) override {
    resize(states, starts_.size());
    for (std::size_t i = 0; i < starts_.size(); ++i) {
      const mjtNum* q = data_->qpos + 3 * i;
      const mjtNum* v = data_->qvel + 3 * i;
      states.positions[i] = starts_[i] + Vector3(q[0], q[1], q[2]);
      states.velocities[i] = Vector3(v[0], v[1], v[2]);
    }
  }

  void touching(std::vector<Impact>& pairs) override {
    for (int i = 0; i < data_->ncon; ++i) {
      if (data_->contact[i].dist > 0) continue;
      const Partner a = partnerOf(data_->contact[i].geom1);
      const Partner b = partnerOf(data_->contact[i].geom2);
      pairs.push_back(a >= 0 ? impactOf(static_cast<BallId>(a), b)
                             : impactOf(static_cast<BallId>(b), a));
    }
  }

 private:
  // Geoms are numbered as written: walls, then balls.
  Partner partnerOf(int geom) const {
    const auto index = static_cast<std::size_t>(geom);
    return index < walls_.size() ? walls_[index] : static_cast<Partner>(index - walls_.size());
  }

  void load(const std::string& text) {
    const auto files = std::make_unique<mjVFS>();
    mj_defaultVFS(files.get());
    mj_makeEmptyFileVFS(files.get(), "balls.xml", static_cast<int>(text.size()));
    std::memcpy(files->filedata[0], text.data(), text.size());
    char error[500] = "";
    model_ = mj_loadXML("balls.xml", files.get(), error, sizeof error);
    mj_deleteVFS(files.get());
    if (model_ == nullptr) throw std::runtime_error(error);
  }

  mjModel* model_ = nullptr;
  mjData* data_ = nullptr;
  std::vector<Vector3> starts_;  // m: slides are counted from here
  std::vector<Partner> walls_;
};

}  // namespace

std::unique_ptr<Peer> makeMujoco(const Surroundings& surroundings, const std::vector<Ball>& balls,
                                 double step) {
  return std::make_unique<Mujoco>(surroundings, balls, step);
}

}  // namespace ball_sim::core::chart
