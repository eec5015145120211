// What one ball-ball collision costs as the number of balls grows, by event_driven, and by
// continuous where it is built in, in frames of 1/60 s.
//
// Periodic cube of equal elastic spheres of 1 m at three packing fractions, in equilibrium, random
// order in memory. Writes one row a state: method, packing_fraction, balls, ns_per_collision,
// bytes_per_ball, rate_over_enskog.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <utility>
#include <vector>

#include "ball_sim/fill.hpp"
#include "ball_sim/methods.hpp"
#include "ball_sim/random_source.hpp"

namespace ball_sim::core::chart {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kFrame = 1.0 / 60;  // s
constexpr double kMixing = 100;      // collisions per ball, before copies are made
constexpr std::size_t kTile = 8000;  // balls that are mixed, at most
constexpr double kWarmUp = 2;        // collisions per ball
constexpr double kCollisions = 3e5;  // counted in each repeat, at least
constexpr int kRepeats = 3;

struct State {
  Surroundings surroundings;
  std::vector<Ball> balls;
};

double cpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Collisions per ball and second, by Enskog's theory with the contact value of Carnahan and
// Starling; diameter, mass and k T are 1.
double enskogRate(double eta) {
  return 4 * std::sqrt(kPi) * (6 * eta / kPi) * (1 - eta / 2) / std::pow(1 - eta, 3);
}

std::unique_ptr<Method> start(const std::string& name, const State& state) {
  auto method = makeMethod(name, state.surroundings);
  for (std::size_t i = 0; i < state.balls.size(); ++i) {
    method->insert(static_cast<BallId>(i), state.balls[i]);
  }
  return method;
}

double meanSquare(const std::vector<Ball>& balls) {
  double sum = 0;
  for (const Ball& ball : balls) sum += dot(ball.velocity, ball.velocity);
  return sum / static_cast<double>(balls.size());
}

// Balls in equilibrium: some are mixed, then copied side by side with new velocities.
State equilibrium(double eta, std::size_t count) {
  int tiles = 1;
  while (count / static_cast<std::size_t>(tiles * tiles * tiles) > kTile) tiles *= 2;
  Scene scene;
  scene.surroundings.periodic = true;
  Fill fill;
  fill.count = count / static_cast<std::size_t>(tiles * tiles * tiles);
  fill.radius = {0.5, 0.5};
  fill.mass = Range{1, 1};
  fill.speed_sigma = 1;
  fill.seed = 1;
  fill.packing_fraction = eta;
  scene.fill = {fill};
  State state;
  state.balls = populate(scene);
  state.surroundings = scene.surroundings;
  const auto mixed = start("event_driven", state);
  mixed->advanceTo(Time::fromSeconds(kMixing / enskogRate(eta)));

  Box& box = state.surroundings.box;
  const Vector3 edge = box.max - box.min;
  const std::size_t in_tile = state.balls.size();
  std::vector<Ball> balls;
  RandomSource random(2);
  for (int tile = 0; tile < tiles * tiles * tiles; ++tile) {
    const Vector3 place(tile % tiles, tile / tiles % tiles, tile / (tiles * tiles));
    for (std::size_t i = 0; i < in_tile; ++i) {
      Ball ball = mixed->ball(static_cast<BallId>(i));
      ball.position += place.cwiseProduct(edge);
      ball.velocity = Vector3(random.normal(), random.normal(), random.normal());
      balls.push_back(ball);
    }
  }
  for (std::size_t i = balls.size() - 1; i > 0; --i) {
    std::swap(balls[i], balls[random.below(i + 1)]);
  }
  const double speed = std::sqrt(meanSquare(balls) / 3);
  for (Ball& ball : balls) ball.velocity /= speed;  // k T is 1, not 1 by chance
  box.max = box.min + tiles * edge;
  state.balls = std::move(balls);
  return state;
}

// Goes on for so many seconds, in frames if the method wants them.
void goOn(Method& method, double seconds, bool in_frames) {
  const Time target = method.now() + seconds;
  while (in_frames && method.now() + kFrame < target) method.advanceTo(method.now() + kFrame);
  method.advanceTo(target);
}

void measure(const std::string& name, double eta, const State& state) {
  const auto count = static_cast<double>(state.balls.size());
  const bool in_frames = name == "continuous";
  const auto method = start(name, state);
  goOn(*method, kWarmUp / enskogRate(eta), in_frames);
  const double duration = std::max(kCollisions / count * 2, 0.5) / enskogRate(eta);
  std::vector<double> costs;  // ns
  std::uint64_t collisions = 0;
  for (int i = 0; i < kRepeats; ++i) {
    const std::uint64_t before = method->statistics().ball_collisions;
    const double begin = cpuSeconds();
    goOn(*method, duration, in_frames);
    const double cpu = cpuSeconds() - begin;
    const std::uint64_t more = method->statistics().ball_collisions - before;
    collisions += more;
    costs.push_back(1e9 * cpu / static_cast<double>(more));
  }
  std::sort(costs.begin(), costs.end());
  const double rate = 2 * static_cast<double>(collisions) / count / (kRepeats * duration);
  std::printf("%s,%g,%zu,%.4g,%.4g,%.4g\n", name.c_str(), eta, state.balls.size(),
              costs[costs.size() / 2], static_cast<double>(method->statistics().bytes) / count,
              rate / enskogRate(eta));
  std::fflush(stdout);
}

void measureAll(std::size_t most) {
  std::printf("method,packing_fraction,balls,ns_per_collision,bytes_per_ball,rate_over_enskog\n");
  const std::vector<std::string>& names = methodNames();
  const bool continuous = std::find(names.begin(), names.end(), "continuous") != names.end();
  for (const double eta : {0.05, 0.2, 0.49}) {
    for (std::size_t count = 1000; count <= most; count *= 10) {
      std::fprintf(stderr, "packing fraction %g, %zu balls\n", eta, count);
      const State state = equilibrium(eta, count);
      measure("event_driven", eta, state);
      if (continuous) measure("continuous", eta, state);
    }
  }
}

}  // namespace
}  // namespace ball_sim::core::chart

// Its argument: the largest number of balls, 1000 to 1000000.
int main(int argc, char** argv) {
  if (argc > 2) {
    std::fputs("usage: ball_sim_scaling [MOST_BALLS] > scaling.csv\n", stderr);
    return 2;
  }
  ball_sim::core::chart::measureAll(argc == 2 ? std::strtoul(argv[1], nullptr, 10) : 1000000);
  return 0;
}
