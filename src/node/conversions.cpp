#include "conversions.hpp"

#include <algorithm>
#include <cmath>

#include "ball_sim/Code.h"
#include "ball_sim/world.hpp"

namespace ball_sim {
namespace {

// The numbers of the ROS interface are those of the core.
constexpr bool same(std::uint8_t code, core::RefusalCode reason) {
  return code == static_cast<std::uint8_t>(reason);
}
static_assert(same(Code::NONE, core::RefusalCode::none), "Code.msg");
static_assert(same(Code::NOT_FINITE, core::RefusalCode::not_finite), "Code.msg");
static_assert(same(Code::OUT_OF_RANGE, core::RefusalCode::out_of_range), "Code.msg");
static_assert(same(Code::OUTSIDE, core::RefusalCode::outside), "Code.msg");
static_assert(same(Code::OVERLAP, core::RefusalCode::overlap), "Code.msg");
static_assert(same(Code::BALL_LIMIT, core::RefusalCode::ball_limit), "Code.msg");
static_assert(same(Code::UNKNOWN_BALL, core::RefusalCode::unknown_ball), "Code.msg");
static_assert(same(Code::FIXED_BALL, core::RefusalCode::fixed_ball), "Code.msg");
static_assert(same(Code::NOT_PLANAR, core::RefusalCode::not_planar), "Code.msg");
static_assert(same(Code::REJECTED_WITH_OTHERS, core::RefusalCode::rejected_with_others),
              "Code.msg");

static_assert(Collision::X_MIN == core::boxFace(0, false), "Collision.msg");
static_assert(Collision::X_MAX == core::boxFace(0, true), "Collision.msg");
static_assert(Collision::Y_MIN == core::boxFace(1, false), "Collision.msg");
static_assert(Collision::Y_MAX == core::boxFace(1, true), "Collision.msg");
static_assert(Collision::Z_MIN == core::boxFace(2, false), "Collision.msg");
static_assert(Collision::Z_MAX == core::boxFace(2, true), "Collision.msg");
static_assert(Collision::FIRST_PLANE == core::planePartner(0), "Collision.msg");

template <class Message>
Message fromVector(const core::Vector3& vector) {
  Message message;
  message.x = vector.x();
  message.y = vector.y();
  message.z = vector.z();
  return message;
}

}  // namespace

geometry_msgs::Point toPoint(const core::Vector3& vector) {
  return fromVector<geometry_msgs::Point>(vector);
}

geometry_msgs::Vector3 toVector(const core::Vector3& vector) {
  return fromVector<geometry_msgs::Vector3>(vector);
}

core::Vector3 fromMessage(const geometry_msgs::Point& point) { return {point.x, point.y, point.z}; }

core::Vector3 fromMessage(const geometry_msgs::Vector3& vector) {
  return {vector.x, vector.y, vector.z};
}

void fillMessage(const core::BallStates& states, BallStates& message) {
  message.ids = states.ids;
  message.positions.resize(states.positions.size());
  message.velocities.resize(states.velocities.size());
  std::transform(states.positions.begin(), states.positions.end(), message.positions.begin(),
                 toPoint);
  std::transform(states.velocities.begin(), states.velocities.end(), message.velocities.begin(),
                 toVector);
}

void fillStates(const BallStates& message, core::BallStates& states) {
  states.ids = message.ids;
  states.positions.clear();
  states.velocities.clear();
  for (const geometry_msgs::Point& position : message.positions) {
    states.positions.push_back(fromMessage(position));
  }
  for (const geometry_msgs::Vector3& velocity : message.velocities) {
    states.velocities.push_back(fromMessage(velocity));
  }
}

Collision toMessage(const core::Collision& collision, std::int64_t start) {
  Collision message;
  message.stamp = toStamp(start + collision.time.nanoseconds());
  message.a = collision.a;
  message.b = collision.b;
  message.point = toPoint(collision.point);
  message.normal = toVector(collision.normal);
  message.impulse = collision.impulse;
  message.approach_speed = collision.approach_speed;
  return message;
}

ros::Time toStamp(std::int64_t nanoseconds) {
  return ros::Time().fromNSec(static_cast<std::uint64_t>(nanoseconds));
}

std::int64_t toNanoseconds(double seconds) {
  // In two parts, as seconds * 1e9 alone is rounded to more than 1 ns after 2^53 ns (104 days).
  const double whole = std::floor(seconds);
  return static_cast<std::int64_t>(whole) * 1000000000 + std::llround((seconds - whole) * 1e9);
}

}  // namespace ball_sim
