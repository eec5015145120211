#include "services.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "ball_sim/text.hpp"
#include "conversions.hpp"

namespace ball_sim {
namespace {

constexpr std::uint32_t kSpinnerThreads = 4;
constexpr std::uint32_t kImpulseThreads = 16;  // so many kicks to come can wait at a time

constexpr double kDefaultRadius = 0.05;  // m, in a scene without movable balls
constexpr double kDefaultMass = 1;       // kg, the same
constexpr std::uint32_t kMaxSteps = 100000;
constexpr double kMinStep = 1e-9;  // s
constexpr double kMaxStep = 3600;  // s

/// A request refused by the node itself.
class RequestRefused : public std::runtime_error {
 public:
  RequestRefused(std::uint8_t code, const std::string& reason)
      : std::runtime_error(reason), code_(code) {}
  std::uint8_t code() const { return code_; }

 private:
  std::uint8_t code_;
};

/// The fields that every answer but Trigger's has.
template <class Answer, class Response>
bool fill(const Answer& answer, Response& response) {
  response.success = answer.success;
  response.message = answer.message;
  response.code = answer.code;
  response.stamp = answer.stamp;
  return true;
}

std::string count(std::size_t number, const std::string& noun) {
  return std::to_string(number) + " " + noun + (number == 1 ? "" : "s");
}

/// Radius and mass of the first ball that can move.
core::Ball firstMovableBall(const core::World& world) {
  for (std::size_t i = 0; i < world.size(); ++i) {
    if (std::isfinite(world.masses()[i])) {
      return world.ball(world.ids()[i]);
    }
  }
  core::Ball ball;
  ball.radius = kDefaultRadius;
  ball.mass = kDefaultMass;
  return ball;
}

ros::NodeHandle withQueue(ros::NodeHandle node, ros::CallbackQueue& queue) {
  node.setCallbackQueue(&queue);
  return node;
}

}  // namespace

Services::Services(const ros::NodeHandle& private_node, Simulator& simulator, double wall_timeout)
    : simulator_(simulator),
      wall_timeout_(wall_timeout),
      default_ball_(firstMovableBall(simulator.world())),
      spinner_(kSpinnerThreads, &queue_),
      impulse_spinner_(kImpulseThreads, &impulse_queue_) {
  ros::NodeHandle node = withQueue(private_node, queue_);
  ros::NodeHandle impulse_node = withQueue(private_node, impulse_queue_);
  servers_ = {
      node.advertiseService("spawn_ball", &Services::spawnBall, this),
      node.advertiseService("spawn_balls", &Services::spawnBalls, this),
      node.advertiseService("delete_balls", &Services::deleteBalls, this),
      impulse_node.advertiseService("apply_impulse", &Services::applyImpulse, this),
      node.advertiseService("step", &Services::step, this),
      node.advertiseService("reset", &Services::reset, this),
      node.advertiseService("pause", &Services::pause, this),
      node.advertiseService("resume", &Services::resume, this),
      node.advertiseService("toggle_pause", &Services::togglePause, this),
  };
  spinner_.start();
  impulse_spinner_.start();
}

Services::~Services() {
  simulator_.commands().close();  // or their threads would wait for answers
  spinner_.stop();
  impulse_spinner_.stop();
}

bool Services::spawnBall(SpawnBall::Request& request, SpawnBall::Response& response) {
  return fill(perform([&](Answer&) {
                const core::Ball ball =
                    ballOf(request.position, request.velocity, request.radius, request.mass);
                response.id = simulator_.world().spawn(ball);
                simulator_.noteChange(true);
                return "added ball " + std::to_string(response.id) + " at " +
                       core::formatVector(ball.position);
              }),
              response);
}

bool Services::spawnBalls(SpawnBalls::Request& request, SpawnBalls::Response& response) {
  return fill(perform([&](Answer&) {
                std::vector<core::Ball> balls;
                for (const Ball& ball : request.balls) {
                  balls.push_back(ballOf(ball.position, ball.velocity, ball.radius, ball.mass));
                }
                const core::SpawnResult result = simulator_.world().spawn(balls);
                for (const core::Refusal& refusal : result.refusals) {
                  response.codes.push_back(static_cast<std::uint8_t>(refusal.code));
                }
                for (std::size_t i = 0; i < result.refusals.size(); ++i) {
                  const core::Refusal& refusal = result.refusals[i];
                  if (refusal && refusal.code != core::RefusalCode::rejected_with_others) {
                    throw RequestRefused(static_cast<std::uint8_t>(refusal.code),
                                         "balls[" + std::to_string(i) + "]: " + refusal.reason);
                  }
                }
                response.ids = result.ids;
                simulator_.noteChange(true);
                return "added " + count(result.ids.size(), "ball");
              }),
              response);
}

bool Services::deleteBalls(DeleteBalls::Request& request, DeleteBalls::Response& response) {
  return fill(perform([&](Answer&) {
                if (!request.all && request.ids.empty()) {
                  throw RequestRefused(Code::OUT_OF_RANGE,
                                       "ids: empty: name at least one ball, or set all");
                }
                core::World& world = simulator_.world();
                const std::size_t before = world.size();
                if (request.all) {
                  world.removeAll();
                } else {
                  world.remove(request.ids);
                }
                simulator_.noteChange(true);
                response.deleted = static_cast<std::uint32_t>(before - world.size());
                return "took out " + count(response.deleted, "ball");
              }),
              response);
}

bool Services::applyImpulse(ApplyImpulse::Request& request, ApplyImpulse::Response& response) {
  const Work kick = [&](Answer&) {
    const auto change = simulator_.world().applyImpulse(request.id, fromMessage(request.impulse));
    simulator_.noteChange(false);
    response.velocity_before = toVector(change.before);
    response.velocity_after = toVector(change.after);
    return "ball " + std::to_string(request.id) + ": velocity " +
           core::formatVector(change.before) + " -> " + core::formatVector(change.after) + " m/s";
  };
  if (request.at == 0) {
    return fill(perform(kick), response);
  }
  std::int64_t at = 0;
  const Answer possible = perform([&](Answer&) {
    at = impulseTime(request.at);
    simulator_.world().ball(request.id);  // throws for an unknown ball
    return std::string();
  });
  return fill(possible.success ? perform(kick, at) : possible, response);
}

bool Services::step(Step::Request& request, Step::Response& response) {
  const auto until = deadline();
  return fill(perform([&](Answer& answer) {
                if (!simulator_.paused()) {
                  throw RequestRefused(Code::NOT_PAUSED, "the simulation runs: pause it first");
                }
                const std::int64_t before = simulator_.now();
                const bool whole = simulator_.step(stepTarget(request), until);
                const double seconds = static_cast<double>(simulator_.now() - before) / 1e9;
                std::string message = "ran " + core::formatNumber(seconds) + " s";
                if (whole) {
                  return message;
                }
                answer.code = Code::TIMED_OUT;
                return message + ", then wall_timeout (" + core::formatNumber(wall_timeout_) +
                       " s) ran out";
              }),
              response);
}

bool Services::reset(Reset::Request& request, Reset::Response& response) {
  return fill(perform([&](Answer&) -> std::string {
                if (request.what.empty() || request.what == "all") {
                  simulator_.reset(false);
                  return "the scene is as it was loaded";
                }
                if (request.what == "time") {
                  simulator_.reset(true);
                  return "the scene is as it was loaded, and time begins again";
                }
                if (request.what == "spawned") {
                  simulator_.commands().withdrawTimed();
                  simulator_.world().removeSpawned();
                  simulator_.noteChange(true);
                  return "the balls added since the scene was loaded are gone";
                }
                throw RequestRefused(Code::OUT_OF_RANGE,
                                     "what: \"" + request.what +
                                         "\": must be \"all\" (or empty), \"spawned\" or \"time\"");
              }),
              response);
}

bool Services::pause(std_srvs::Trigger::Request& /*request*/,
                     std_srvs::Trigger::Response& response) {
  return setPaused([](bool) { return true; }, response);
}

bool Services::resume(std_srvs::Trigger::Request& /*request*/,
                      std_srvs::Trigger::Response& response) {
  return setPaused([](bool) { return false; }, response);
}

bool Services::togglePause(std_srvs::Trigger::Request& /*request*/,
                           std_srvs::Trigger::Response& response) {
  return setPaused([](bool paused) { return !paused; }, response);
}

/// @param wanted  from whether it is paused to whether it shall be
bool Services::setPaused(const std::function<bool(bool)>& wanted,
                         std_srvs::Trigger::Response& response) {
  const Answer answer = perform([&](Answer&) {
    const bool before = simulator_.paused();
    const bool after = wanted(before);
    simulator_.setPaused(after);
    return std::string(before == after ? "already " : "") + (after ? "paused" : "running");
  });
  response.success = answer.success;
  response.message = answer.message;
  return true;
}

/// Has `work` done by the world's thread and makes an answer of what comes of it.
/// @param at  simulated time, ns
Services::Answer Services::perform(const Work& work, std::int64_t at) {
  Answer answer;
  const auto refuse = [&](std::uint8_t code, const std::string& reason) {
    answer.success = false;
    answer.code = code;
    answer.message = reason;
  };
  const auto attempt = [&] {
    try {
      answer.success = true;
      answer.message = work(answer);
    } catch (const core::Refused& refused) {
      refuse(static_cast<std::uint8_t>(refused.code()), refused.what());
    } catch (const RequestRefused& refused) {
      refuse(refused.code(), refused.what());
    } catch (const std::exception& error) {
      refuse(Code::FAILED, error.what());
    }
    answer.stamp = simulator_.stamp();
  };
  switch (simulator_.commands().execute(attempt, at, deadline())) {
    case CommandQueue::Outcome::done:
      break;
    case CommandQueue::Outcome::timed_out:
      refuse(Code::TIMED_OUT, "not possible within wall_timeout (" +
                                  core::formatNumber(wall_timeout_) +
                                  " s of wall time); withdrawn");
      break;
    case CommandQueue::Outcome::withdrawn:
      refuse(Code::WITHDRAWN, "withdrawn by a reset or the end of the node");
      break;
  }
  return answer;
}

CommandQueue::Clock::time_point Services::deadline() const {
  return CommandQueue::Clock::now() + std::chrono::duration_cast<CommandQueue::Clock::duration>(
                                          std::chrono::duration<double>(wall_timeout_));
}

/// Fills in the scene's defaults.
core::Ball Services::ballOf(const geometry_msgs::Point& position,
                            const geometry_msgs::Vector3& velocity, double radius,
                            double mass) const {
  core::Ball ball;
  ball.position = fromMessage(position);
  ball.velocity = fromMessage(velocity);
  ball.radius = radius == 0 ? default_ball_.radius : radius;
  ball.mass = mass == 0 ? default_ball_.mass : mass;
  return ball;
}

/// @return simulated time, ns. @throws RequestRefused
std::int64_t Services::stepTarget(const Step::Request& request) const {
  if ((request.steps == 0) == (request.seconds == 0)) {
    throw RequestRefused(Code::OUT_OF_RANGE, "give either steps or seconds");
  }
  if (request.steps > kMaxSteps) {
    throw RequestRefused(Code::OUT_OF_RANGE, "steps: " + std::to_string(request.steps) +
                                                 ": must be 1 to " + std::to_string(kMaxSteps));
  }
  if (request.steps > 0) {
    return simulator_.stateInstant(request.steps);
  }
  if (!std::isfinite(request.seconds)) {
    throw RequestRefused(Code::NOT_FINITE,
                         "seconds: " + core::formatNumber(request.seconds) + ": must be finite");
  }
  if (request.seconds < kMinStep || request.seconds > kMaxStep) {
    throw RequestRefused(Code::OUT_OF_RANGE, "seconds: " + core::formatNumber(request.seconds) +
                                                 ": must be " + core::formatNumber(kMinStep) +
                                                 " to " + core::formatNumber(kMaxStep));
  }
  return simulator_.now() + toNanoseconds(request.seconds);
}

/// @param at  s, ROS time. @return simulated time, ns. @throws RequestRefused
std::int64_t Services::impulseTime(double at) {
  const std::string given = "at: " + core::formatNumber(at) + ": ";
  if (!std::isfinite(at)) {
    throw RequestRefused(Code::NOT_FINITE, given + "must be finite");
  }
  constexpr double kEndOfRosTime = 4294967296.0;  // s
  if (at < 0 || at >= kEndOfRosTime) {
    throw RequestRefused(Code::OUT_OF_RANGE,
                         given + "must be 0 to " + core::formatNumber(kEndOfRosTime));
  }
  const std::int64_t time = toNanoseconds(at) - simulator_.start();
  if (time < simulator_.now()) {
    throw RequestRefused(
        Code::IN_THE_PAST,
        given + "is in the past: it is " + core::formatNumber(simulator_.stamp().toSec()) + " s");
  }
  return time;
}

}  // namespace ball_sim
