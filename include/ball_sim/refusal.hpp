// Why a request was refused, as data.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace ball_sim::core {

/// Why something was refused. The numbers are part of the ROS interface: append only.
enum class RefusalCode : std::uint8_t {
  none = 0,
  not_finite = 1,            ///< NaN or infinity where a number is needed
  out_of_range = 2,          ///< finite, but not allowed (zero radius, ...)
  outside = 3,               ///< beyond a wall
  overlap = 4,               ///< into another ball
  ball_limit = 5,            ///< more balls than max_balls
  unknown_ball = 6,          ///< no ball with that id
  fixed_ball = 7,            ///< a ball of infinite mass cannot be moved
  not_planar = 8,            ///< out of the plane of a planar scene
  rejected_with_others = 9,  ///< fine by itself, but another of the same request was refused
};

struct Refusal {
  RefusalCode code = RefusalCode::none;  ///< none: accepted
  std::string reason;                    ///< names the thing, the value and the rule

  explicit operator bool() const { return code != RefusalCode::none; }
};

/// A request on the world that was refused; the world is as it was.
class Refused : public std::runtime_error {
 public:
  explicit Refused(const Refusal& refusal)
      : std::runtime_error(refusal.reason), code_(refusal.code) {}
  RefusalCode code() const { return code_; }

 private:
  RefusalCode code_;
};

}  // namespace ball_sim::core
