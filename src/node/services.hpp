// The node's services: requests become work for the world's thread, and refusals become answers.
#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <ros/spinner.h>
#include <std_srvs/Trigger.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "ball_sim/ApplyImpulse.h"
#include "ball_sim/Code.h"
#include "ball_sim/DeleteBalls.h"
#include "ball_sim/Reset.h"
#include "ball_sim/SpawnBall.h"
#include "ball_sim/SpawnBalls.h"
#include "ball_sim/Step.h"
#include "simulator.hpp"

namespace ball_sim {

/// Serves while it lives, in threads of its own.
class Services {
 public:
  /// @param wall_timeout  s of wall time, within which every request is answered
  Services(const ros::NodeHandle& private_node, Simulator& simulator, double wall_timeout);
  ~Services();

 private:
  struct Answer {
    bool success = false;
    std::string message;
    std::uint8_t code = Code::NONE;
    ros::Time stamp;
  };

  /// What a request does: returns the message for its answer, or throws why not.
  using Work = std::function<std::string(Answer&)>;

  bool spawnBall(SpawnBall::Request& request, SpawnBall::Response& response);
  bool spawnBalls(SpawnBalls::Request& request, SpawnBalls::Response& response);
  bool deleteBalls(DeleteBalls::Request& request, DeleteBalls::Response& response);
  bool applyImpulse(ApplyImpulse::Request& request, ApplyImpulse::Response& response);
  bool step(Step::Request& request, Step::Response& response);
  bool reset(Reset::Request& request, Reset::Response& response);
  bool pause(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool resume(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool togglePause(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);

  Answer perform(const Work& work, std::int64_t at = CommandQueue::kNow);
  bool setPaused(const std::function<bool(bool)>& wanted, std_srvs::Trigger::Response& response);
  CommandQueue::Clock::time_point deadline() const;
  core::Ball ballOf(const geometry_msgs::Point& position, const geometry_msgs::Vector3& velocity,
                    double radius, double mass) const;
  std::int64_t stepTarget(const Step::Request& request) const;
  std::int64_t impulseTime(double at);

  Simulator& simulator_;
  const double wall_timeout_;  // s
  core::Ball default_ball_;    // radius and mass of balls that give none

  // Kicks to come block the thread that serves them; they have threads of their own, so that
  // everything else is answered meanwhile.
  ros::CallbackQueue queue_;
  ros::CallbackQueue impulse_queue_;
  std::vector<ros::ServiceServer> servers_;
  ros::AsyncSpinner spinner_;
  ros::AsyncSpinner impulse_spinner_;
};

}  // namespace ball_sim
