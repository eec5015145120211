// LAMMPS (lammps.org), granular package, one process.
//
// Settings: pair gran/hooke, a linear spring without friction (xmu 0) and without damping where
// restitution is 1; else gamma_n = -2 ln(e)/t_c. The lightest pair's contact lasts t_c = 20 steps
// (LAMMPS manual, "pair_style gran/hooke": a contact wants some tens of steps); walls by fix
// wall/gran with twice the stiffness, as a wall doubles the reduced mass. Neighbour lists are
// checked at every step, skin a third of a diameter. Contacts are told from overlaps.
#include <lammps/library.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "ball_sim/overlap_index.hpp"
#include "ball_sim/walls.hpp"
#include "peer.hpp"

namespace ball_sim::core::chart {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kContactSteps = 20;

std::string number(double value) {
  std::ostringstream text;
  text.precision(17);
  text << value;
  return text.str();
}

class Lammps final : public Peer {
 public:
  Lammps(const Surroundings& surroundings, const std::vector<Ball>& balls, double step)
      : surroundings_(surroundings), walls_(wallsOf<double>(surroundings)) {
    const char* arguments[] = {"lammps", "-screen", "none", "-log", "none"};
    lammps_ = lammps_open_no_mpi(5, const_cast<char**>(arguments), nullptr);
    if (lammps_ == nullptr) throw std::runtime_error("LAMMPS could not be started");
    for (const Ball& ball : balls) radii_.push_back(ball.radius);
    makeBox(balls);
    addBalls(balls);
    addForces(balls, step);
    command("run 0");
  }

  ~Lammps() override { lammps_close(lammps_); }
  Lammps(const Lammps&) = delete;
  Lammps& operator=(const Lammps&) = delete;

  void advance(std::uint64_t steps) override {
    command("run " + std::to_string(steps) + " pre no post no");
  }

  void read(BallStates& states) override {
    if (lammps_get_natoms(lammps_) != static_cast<double>(radii_.size())) {
      throw std::runtime_error("lost balls");
    }
    resize(states, radii_.size());
    std::vector<double> x(3 * radii_.size());
    std::vector<double> v(x.size());
    gather("x", x);
    gather("v", v);
    for (std::size_t i = 0; i < radii_.size(); ++i) {
      states.positions[i] = Vector3(x[3 * i], x[3 * i + 1], x[3 * i + 2]);
      states.velocities[i] = Vector3(v[3 * i], v[3 * i + 1], v[3 * i + 2]);
    }
  }

  void touching(std::vector<Impact>& pairs) override {
    read(states_);
    OverlapIndex index(surroundings_);
    std::vector<std::size_t> partners;
    for (std::size_t i = 0; i < radii_.size(); ++i) {
      index.findAll(states_.positions[i], radii_[i], partners);
      for (const std::size_t j : partners) {
        pairs.push_back(impactOf(static_cast<BallId>(i), static_cast<Partner>(j)));
      }
      index.insert(i, states_.positions[i], radii_[i]);
      for (const Wall<double>& wall : walls_) {
        if (dot(states_.positions[i], wall.normal) - wall.offset < radii_[i]) {
          pairs.push_back({static_cast<BallId>(i), wall.partner});
        }
      }
    }
  }

 private:
  void command(const std::string& text) {
    lammps_command(lammps_, text.c_str());
    if (lammps_has_error(lammps_) != 0) {
      char message[500];
      lammps_get_last_error_message(lammps_, message, sizeof message);
      throw std::runtime_error(message);
    }
  }

  void gather(const char* what, std::vector<double>& values) {
    lammps_gather_atoms(lammps_, const_cast<char*>(what), 1, 3, values.data());
  }

  // Faces with walls stay where they are, a radius further out; open ones follow the balls.
  void makeBox(const std::vector<Ball>& balls) {
    command("units lj");
    command("atom_style sphere");
    command("atom_modify map array sort 0 0");
    command("newton off");
    command("comm_modify vel yes");
    std::string kinds = "boundary";
    std::string extents;
    for (int axis = 0; axis < 3; ++axis) {
      kinds += isPeriodic(axis) ? " p" : " " + boundaryOf(axis, false) + boundaryOf(axis, true);
      const auto [low, high] = extentOf(axis, balls);
      extents += " " + number(low) + " " + number(high);
    }
    command(kinds);
    command("region box block" + extents);
    command("create_box 1 box");
  }

  std::pair<double, double> extentOf(int axis, const std::vector<Ball>& balls) const {
    double low = surroundings_.box.min[axis];
    double high = surroundings_.box.max[axis];
    if (isPeriodic(axis)) return {low, high};
    const double reach = *std::max_element(radii_.begin(), radii_.end());
    const auto [first, last] = std::minmax_element(
        balls.begin(), balls.end(),
        [&](const Ball& a, const Ball& b) { return a.position[axis] < b.position[axis]; });
    low = isWall(axis, low) ? low - reach : first->position[axis] - 20 * reach;
    high = isWall(axis, high) ? high + reach : last->position[axis] + 20 * reach;
    return {low, high};
  }

  bool isPeriodic(int axis) const {
    return surroundings_.periodic && !(axis == 2 && surroundings_.planar());
  }

  bool isWall(int axis, double face) const {
    return std::isfinite(face) && !(axis == 2 && surroundings_.planar());
  }

  std::string boundaryOf(int axis, bool upper) const {
    const double face = upper ? surroundings_.box.max[axis] : surroundings_.box.min[axis];
    return isWall(axis, face) ? "f" : "m";
  }

  void addBalls(const std::vector<Ball>& balls) {
    std::vector<int> types(balls.size(), 1);
    std::vector<int> ids;
    std::vector<double> x, v, masses;
    for (std::size_t i = 0; i < balls.size(); ++i) {
      ids.push_back(static_cast<int>(i + 1));
      masses.push_back(balls[i].mass);
      for (int axis = 0; axis < 3; ++axis) {
        x.push_back(balls[i].position[axis]);
        v.push_back(balls[i].velocity[axis]);
      }
    }
    lammps_create_atoms(lammps_, static_cast<int>(balls.size()), ids.data(), types.data(), x.data(),
                        v.data(), nullptr, 0);
    lammps_scatter_atoms(lammps_, const_cast<char*>("radius"), 1, 1, radii_.data());
    lammps_scatter_atoms(lammps_, const_cast<char*>("rmass"), 1, 1, masses.data());
  }

  void addForces(const std::vector<Ball>& balls, double step) {
    double lightest = balls[0].mass;
    double smallest = balls[0].radius;
    for (const Ball& ball : balls) {
      lightest = std::min(lightest, ball.mass);
      smallest = std::min(smallest, ball.radius);
    }
    const double contact_time = kContactSteps * step;
    const double damping = -2 * std::log(surroundings_.restitution) / contact_time;
    const double stiffness =
        lightest / 2 * (std::pow(kPi / contact_time, 2) + damping * damping / 4);
    const auto law = [&](double spring) {
      return "hooke " + number(spring) + " NULL " + number(damping) + " NULL 0 0";
    };
    command("pair_style gran/" + law(stiffness));
    command("pair_coeff * *");
    command("neighbor " + number(smallest * 2 / 3) + " bin");
    command("neigh_modify delay 0 every 1 check yes");
    command("fix motion all nve/sphere");
    const Vector3& g = surroundings_.gravity;
    if (g != Vector3::Zero()) {
      command("fix weight all gravity " + number(g.norm()) + " vector " + number(g.x()) + " " +
              number(g.y()) + " " + number(g.z()));
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (isPeriodic(axis) || (axis == 2 && surroundings_.planar())) continue;
      const auto face = [](double at) { return std::isinf(at) ? "NULL" : number(at); };
      const std::string low = face(surroundings_.box.min[axis]);
      const std::string high = face(surroundings_.box.max[axis]);
      if (low == "NULL" && high == "NULL") continue;
      const std::string name(1, "xyz"[axis]);
      command("fix wall_" + name + " all wall/gran " + law(2 * stiffness) + " " + name + "plane " +
              low + " " + high);
    }
    command("timestep " + number(step));
    command("thermo 0");
    command("thermo_modify lost ignore");  // read() tells of them, instead of an end of the process
  }

  Surroundings surroundings_;
  std::vector<Wall<double>> walls_;
  std::vector<double> radii_;  // m
  void* lammps_;
  BallStates states_;
};

}  // namespace

std::unique_ptr<Peer> makeLammps(const Surroundings& surroundings, const std::vector<Ball>& balls,
                                 double step) {
  return std::make_unique<Lammps>(surroundings, balls, step);
}

}  // namespace ball_sim::core::chart
