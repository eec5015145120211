// The only bridge between the core's types and ROS messages. Stateless.
#pragma once

#include <cstdint>
#include <vector>

#include "ball_sim/BallStates.h"
#include "ball_sim/Collision.h"
#include "ball_sim/ball.hpp"
#include "ball_sim/method.hpp"

namespace ball_sim {

geometry_msgs::Point toPoint(const core::Vector3& vector);
geometry_msgs::Vector3 toVector(const core::Vector3& vector);
core::Vector3 fromMessage(const geometry_msgs::Point& point);
core::Vector3 fromMessage(const geometry_msgs::Vector3& vector);

/// Fills all but the header, and reuses the message's memory.
void fillMessage(const core::BallStates& states, BallStates& message);

/// The way back. The time is left alone; reuses the memory of `states`.
/// @param message  with as many positions and velocities as ids
void fillStates(const BallStates& message, core::BallStates& states);

/// @param start  ROS time of simulated time 0, ns
Collision toMessage(const core::Collision& collision, std::int64_t start);

/// @param nanoseconds  ns, >= 0
/// @throws std::runtime_error  beyond the year 2106, where ROS time ends
ros::Time toStamp(std::int64_t nanoseconds);

/// @param seconds  s, magnitude below 9e9. @return ns, rounded to nearest
std::int64_t toNanoseconds(double seconds);

}  // namespace ball_sim
