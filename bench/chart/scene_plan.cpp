// The scenes of the chart.
#include "scene_plan.hpp"

#include <algorithm>
#include <limits>

#include "ball_sim/fill.hpp"
#include "ball_sim/methods.hpp"
#include "ball_sim/scene_reader.hpp"

namespace ball_sim::core::chart {
namespace {

// Two collisions a ball or so: later the steppers' errors only grow by chaos.
ScenePlan fluid(const std::string& density, const std::string& count, double horizon,
                double statistics, double mixing) {
  ScenePlan plan;
  plan.name = "fluid_" + density + "_" + count;
  plan.file = "bench/chart/scenes/" + plan.name + ".yaml";
  plan.question = "hard spheres, periodic, number density " + density + ", N = " + count +
                  ": paths, pressure, collision rate";
  plan.speed = 1.7320508075688772;  // root mean square at kT = m = 1
  plan.horizon = horizon;
  plan.statistics = statistics;
  plan.mixing = mixing;
  plan.truth = Truth::oracle;
  if (count != "100") plan.repeats = 10;
  return plan;
}

std::vector<ScenePlan> allPlans() {
  const std::string here = "bench/chart/scenes/";
  return {
      {"two_balls", "config/scenes/two_balls.yaml", "two unequal balls meet off-centre, once",
       7.0710678118654755, 10},
      {"pi_billiard", here + "pi_billiard.yaml",
       "masses 1 : 1 000 000 and a wall: 3141 impacts, the digits of pi", 1, 4},
      {"cradle", here + "cradle.yaml", "Newton's cradle with small gaps: one in, one out", 0.5, 4},
      {"twelve_discs", here + "twelve_discs.yaml", "twelve discs in a closed box", 1, 0.15, 300, 0,
       Truth::oracle},
      fluid("0.2", "100", 0.8, 80, 100),
      fluid("0.2", "10000", 0.8, 2, 30),
      fluid("0.5", "100", 0.2, 25, 30),
      fluid("0.5", "10000", 0.2, 0.5, 8),
      fluid("0.9", "100", 0.05, 6, 20),
      fluid("0.9", "10000", 0.05, 0.12, 8),
      {"polydisperse", here + "polydisperse.yaml",
       "a closed box of balls with radii 1 to 3, masses 1 to 27", 1, 0.3, 10, 0, Truth::oracle},
      {"bouncing", here + "bouncing.yaml",
       "a ball dropped from 5 m, restitution 0.9: height, and the date of each bounce", 10, 15},
      {"stack", here + "stack.yaml", "a stack of ten balls at rest: nothing may move", 1, 1, 0, 0,
       Truth::at_rest, 3},
      {"fast_bullet", here + "fast_bullet.yaml", "a small ball at 100 m/s among slow ones", 1,
       0.06},
      {"break_shot", "config/scenes/break_shot.yaml",
       "the break shot: sixteen billiard balls, restitution 0.95", 8, 0.6},
      {"box_gas", here + "box_gas.yaml", "a thousand balls in a closed cube, a tenth of it taken",
       1.7320508075688772, 0.1, 1, 1, Truth::oracle, 10},
      {"box_gas_2d", here + "box_gas_2d.yaml",
       "a thousand discs in a closed square, a fifth of it taken", 1.4142135623730951, 0.1, 1, 1,
       Truth::oracle, 10},
  };
}

double smallestReach(const std::vector<Ball>& balls) {
  double smallest = std::numeric_limits<double>::infinity();
  double second = smallest;
  for (const Ball& ball : balls) {
    second = std::min(second, std::max(smallest, ball.radius));
    smallest = std::min(smallest, ball.radius);
  }
  return balls.size() > 1 ? smallest + second : smallest;
}

void mix(PreparedScene& scene) {
  const auto method = makeMethod("event_driven", scene.surroundings);
  for (std::size_t i = 0; i < scene.balls.size(); ++i) {
    method->insert(static_cast<BallId>(i), scene.balls[i]);
  }
  method->advanceTo(Time::fromSeconds(scene.plan.mixing));
  for (std::size_t i = 0; i < scene.balls.size(); ++i) {
    scene.balls[i] = method->ball(static_cast<BallId>(i));
  }
}

}  // namespace

const char* nameOf(Truth truth) {
  switch (truth) {
    case Truth::all_pairs:
      return "256 bits, all pairs by the templates of brute_force";
    case Truth::oracle:
      return "256 bits, a code of its own (bench/chart/oracle.cpp)";
    case Truth::at_rest:
      break;
  }
  return "closed form: nothing moves";
}

const std::vector<ScenePlan>& scenePlans() {
  static const std::vector<ScenePlan> plans = allPlans();
  return plans;
}

PreparedScene prepare(const ScenePlan& plan, const std::string& source_folder) {
  Scene read = readScene(source_folder + "/" + plan.file);
  PreparedScene scene;
  scene.plan = plan;
  scene.balls = populate(read);
  scene.surroundings = read.surroundings;
  scene.reach = smallestReach(scene.balls);
  if (plan.mixing > 0) mix(scene);
  return scene;
}

}  // namespace ball_sim::core::chart
