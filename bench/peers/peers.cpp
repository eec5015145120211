// The other engines as entrants of the chart.
#include "peers.hpp"

#include <algorithm>
#include <iterator>

#include "peer.hpp"

namespace ball_sim::core::chart {
namespace {

using MakePeer = std::unique_ptr<Peer> (*)(const Surroundings&, const std::vector<Ball>&, double);

// An impact is a pair that touches and did not touch in the step before.
class PeerSimulation final : public Simulation {
 public:
  explicit PeerSimulation(std::unique_ptr<Peer> peer) : peer_(std::move(peer)) {}

  void advance(std::uint64_t steps) override { peer_->advance(steps); }

  void read(BallStates& states) override { peer_->read(states); }

  void takeImpacts(std::vector<Impact>& impacts) override {
    touching_.clear();
    peer_->touching(touching_);
    std::sort(touching_.begin(), touching_.end());
    touching_.erase(std::unique(touching_.begin(), touching_.end()), touching_.end());
    std::set_difference(touching_.begin(), touching_.end(), before_.begin(), before_.end(),
                        std::back_inserter(impacts));
    before_.swap(touching_);
  }

 private:
  std::unique_ptr<Peer> peer_;
  std::vector<Impact> before_, touching_;  // sorted
};

std::string none(const PreparedScene& /*scene*/) { return ""; }

std::string refusalOfPeriodic(const PreparedScene& scene) {
  return scene.surroundings.periodic ? "has no periodic box" : "";
}

std::string refusalOfSpace(const PreparedScene& scene) {
  return scene.planar() ? refusalOfPeriodic(scene) : "is planar";
}

Entrant entrant(const std::string& name, double cost, std::string (*refusal)(const PreparedScene&),
                MakePeer make) {
  Entrant one;
  one.name = name;
  one.kind = Kind::peer;
  one.cost = cost;
  one.refusal = refusal;
  one.make = [make](const Surroundings& surroundings, const std::vector<Ball>& balls,
                    double step) -> std::unique_ptr<Simulation> {
    return std::make_unique<PeerSimulation>(make(surroundings, balls, step));
  };
  return one;
}

}  // namespace

void resize(BallStates& states, std::size_t count) {
  states.ids.resize(count);
  states.positions.resize(count);
  states.velocities.resize(count);
  for (std::size_t i = 0; i < count; ++i) states.ids[i] = static_cast<BallId>(i);
}

std::vector<Entrant> peers() {
  Entrant mujoco = entrant("mujoco", 5000, refusalOfPeriodic, makeMujoco);
  mujoco.setup_cost = 2.6e-3;  // measured at 1000 balls
  return {entrant("bullet", 2000, refusalOfPeriodic, makeBullet),
          entrant("ode", 1200, refusalOfPeriodic, makeOde),
          entrant("box2d", 1000, refusalOfSpace, makeBox2d),
          entrant("chipmunk", 500, refusalOfSpace, makeChipmunk),
          mujoco,
          entrant("lammps", 1500, none, makeLammps)};
}

}  // namespace ball_sim::core::chart
