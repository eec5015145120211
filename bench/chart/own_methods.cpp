// Our methods on the chart. event_driven, brute_force and auto are asked for no time step; every
// other method is swept over it.
#include "ball_sim/auto_method.hpp"
#include "ball_sim/methods.hpp"
#include "entrant.hpp"

namespace ball_sim::core::chart {
namespace {

// More would be a stalled clock.
constexpr std::uint64_t kMostEvents = 2'000'000'000;

class OwnSimulation final : public Simulation {
 public:
  OwnSimulation(std::unique_ptr<Method> method, bool in_frames, const std::vector<Ball>& balls,
                double step)
      : method_(std::move(method)), step_(step), in_frames_(in_frames) {
    for (std::size_t i = 0; i < balls.size(); ++i) {
      method_->insert(static_cast<BallId>(i), balls[i]);
    }
  }

  // A frame of `continuous` is one call; those without a step go all the way in one.
  void advance(std::uint64_t steps) override {
    for (std::uint64_t i = 0; i < (in_frames_ ? steps : 1); ++i) {
      steps_ += in_frames_ ? 1 : steps;
      const Time target = Time::fromSeconds(static_cast<double>(steps_) * step_);
      if (!method_->advanceTo(target, kMostEvents)) throw std::runtime_error("the clock stalls");
    }
  }

  void read(BallStates& states) override { method_->read(states); }

  // The log is taken up at the first call, so that a run that is timed carries none.
  void takeImpacts(std::vector<Impact>& impacts) override {
    method_->setCollisionLog(&log_);
    for (const Collision& collision : log_.entries) {
      impacts.push_back(impactOf(collision.a, collision.b));
    }
    log_.entries.clear();
  }

  Work work() const override {
    const Statistics statistics = method_->statistics();
    return {statistics.events, statistics.ball_collisions, statistics.virial,
            statistics.deepest_overlap};
  }

 private:
  CollisionLog log_;  // outlives the method
  std::unique_ptr<Method> method_;
  double step_;  // s
  bool in_frames_;
  std::uint64_t steps_ = 0;  // so far
};

std::unique_ptr<Method> make(const std::string& name, const Surroundings& surroundings,
                             const std::vector<Ball>& balls, double step) {
  MethodSettings settings;
  if (name == "auto") {
    Scene scene;
    scene.surroundings = surroundings;
    return std::make_unique<AutoMethod>(surroundings, settings, chooseMethod(name, scene, balls));
  }
  settings.time_step = step;
  return makeMethod(name, surroundings, settings);
}

// All pairs: from a thousand balls on it would take minutes.
std::string refusalOfBruteForce(const PreparedScene& scene) {
  return scene.balls.size() > 200 ? "all pairs, at every event: too slow for so many balls" : "";
}

}  // namespace

std::vector<Entrant> ownMethods() {
  std::vector<Entrant> entrants;
  for (const std::string& name : methodNames()) {
    Entrant entrant;
    entrant.name = name;
    const bool exact = name == "event_driven" || name == "brute_force" || name == "auto";
    entrant.kind = exact ? Kind::exact : Kind::stepped;
    entrant.cost = 150;
    entrant.refusal = [](const PreparedScene&) { return std::string(); };
    if (name == "brute_force") entrant.refusal = refusalOfBruteForce;
    entrant.make = [name, exact](const Surroundings& surroundings, const std::vector<Ball>& balls,
                                 double step) {
      return std::make_unique<OwnSimulation>(make(name, surroundings, balls, step), !exact, balls,
                                             step);
    };
    entrants.push_back(entrant);
  }
  return entrants;
}

}  // namespace ball_sim::core::chart
