#include "parameters.hpp"

#include <ros/console.h>
#include <ros/param.h>

#include <algorithm>
#include <limits>
#include <sstream>
#include <vector>

#include "ball_sim/nearest_name.hpp"
#include "ball_sim/text.hpp"

namespace ball_sim {
namespace {

std::string describe(const XmlRpc::XmlRpcValue& value) {
  std::ostringstream text;
  value.write(text);
  return text.str();
}

/// Reads parameters one by one and remembers their names.
class Reader {
 public:
  explicit Reader(const ros::NodeHandle& node) : node_(node) {}

  /// @return nothing when the parameter is not set
  std::optional<double> number(const std::string& name, double lower, double upper) {
    return numberWithin(name, lower, upper, false);
  }

  /// The same, but 0 is allowed beside the range.
  std::optional<double> numberOrZero(const std::string& name, double lower, double upper) {
    return numberWithin(name, lower, upper, true);
  }

  /// The same, and 0 stands for a parameter that is not set: launch files cannot leave one out.
  std::optional<double> numberOrAbsent(const std::string& name, double lower, double upper) {
    const std::optional<double> number = numberOrZero(name, lower, upper);
    return number == 0.0 ? std::nullopt : number;
  }

  std::optional<int> integer(const std::string& name, int lower, int upper) {
    auto value = find(name);
    if (!value) {
      return std::nullopt;
    }
    const bool is_integer = value->getType() == XmlRpc::XmlRpcValue::TypeInt;
    if (!is_integer || static_cast<int&>(*value) < lower || static_cast<int&>(*value) > upper) {
      refuse(name, *value,
             "must be a whole number, " + std::to_string(lower) + " to " + std::to_string(upper));
    }
    return static_cast<int&>(*value);
  }

  std::optional<bool> truth(const std::string& name) {
    auto value = find(name);
    if (!value) {
      return std::nullopt;
    }
    if (value->getType() != XmlRpc::XmlRpcValue::TypeBoolean) {
      refuse(name, *value, "must be true or false");
    }
    return static_cast<bool&>(*value);
  }

  std::optional<std::string> text(const std::string& name) {
    auto value = find(name);
    if (!value) {
      return std::nullopt;
    }
    if (value->getType() != XmlRpc::XmlRpcValue::TypeString) {
      refuse(name, *value, "must be text");
    }
    return static_cast<std::string&>(*value);
  }

  [[noreturn]] static void refuse(const std::string& name, const XmlRpc::XmlRpcValue& value,
                                  const std::string& rule) {
    throw ParameterError("parameter ~" + name + ": " + describe(value) + ": " + rule);
  }

  /// Warns of every private parameter that nobody has asked for.
  void warnOfUnknown() const {
    std::vector<std::string> names;
    ros::param::getParamNames(names);
    const std::string prefix = node_.getNamespace() + "/";
    for (const std::string& full_name : names) {
      if (full_name.compare(0, prefix.size(), prefix) != 0) {
        continue;
      }
      const std::string name = full_name.substr(prefix.size());
      if (std::find(known_.begin(), known_.end(), name) == known_.end()) {
        const std::optional<std::string> near = core::nearestName(name, known_);
        ROS_WARN_STREAM("unknown parameter ~" << name << " is ignored; "
                                              << (near ? "did you mean ~" + *near + "?"
                                                       : "known are: " + core::formatList(known_)));
      }
    }
  }

 private:
  std::optional<XmlRpc::XmlRpcValue> find(const std::string& name) {
    known_.push_back(name);
    XmlRpc::XmlRpcValue value;
    return node_.getParam(name, value) ? std::optional<XmlRpc::XmlRpcValue>(value) : std::nullopt;
  }

  std::optional<double> numberWithin(const std::string& name, double lower, double upper,
                                     bool zero_too) {
    auto value = find(name);
    if (!value) {
      return std::nullopt;
    }
    double number = std::numeric_limits<double>::quiet_NaN();
    if (value->getType() == XmlRpc::XmlRpcValue::TypeInt) {
      number = static_cast<int&>(*value);
    } else if (value->getType() == XmlRpc::XmlRpcValue::TypeDouble) {
      number = static_cast<double&>(*value);
    }
    const bool good = (zero_too && number == 0) || (number >= lower && number <= upper);
    if (!good) {  // NaN too
      refuse(name, *value,
             "must be a number, " + std::string(zero_too ? "0 or " : "") +
                 core::formatNumber(lower) + " to " + core::formatNumber(upper));
    }
    return number;
  }

  ros::NodeHandle node_;
  std::vector<std::string> known_;
};

}  // namespace

Parameters readParameters(const ros::NodeHandle& private_node) {
  Reader reader(private_node);
  Parameters p;
  p.scene = reader.text("scene").value_or(p.scene);
  p.method = reader.text("method").value_or(p.method);
  p.time_step = reader.numberOrAbsent("time_step", 1e-9, 1);
  p.tolerance = reader.numberOrAbsent("tolerance", 1e-15, 1);
  p.threads = reader.integer("threads", 1, 1024).value_or(p.threads);
  const int seed = reader.integer("seed", -1, std::numeric_limits<int>::max()).value_or(-1);
  if (seed >= 0) {
    p.seed = seed;
  }
  p.frame_id = reader.text("frame_id").value_or(p.frame_id);
  if (p.frame_id.empty()) {
    Reader::refuse("frame_id", p.frame_id, "must not be empty");
  }
  p.real_time_factor =
      reader.numberOrZero("real_time_factor", 1e-3, 1e3).value_or(p.real_time_factor);
  p.clock_rate = reader.number("clock_rate", 10, 250).value_or(p.clock_rate);
  p.state_rate = reader.numberOrZero("state_rate", 1e-3, 1000).value_or(p.state_rate);
  p.marker_rate = reader.numberOrZero("marker_rate", 0.1, 60).value_or(p.marker_rate);
  p.publish_clock = reader.truth("publish_clock").value_or(p.publish_clock);
  p.start_paused = reader.truth("start_paused").value_or(p.start_paused);
  p.wait_for_viewer = reader.numberOrZero("wait_for_viewer", 0.1, 600).value_or(p.wait_for_viewer);
  p.start_time = reader.number("start_time", 1e-9, 4e9).value_or(p.start_time);
  p.max_balls = reader.integer("max_balls", 1, 10000000).value_or(p.max_balls);
  p.max_events_per_frame =
      reader.integer("max_events_per_frame", 1, 1000000000).value_or(p.max_events_per_frame);
  p.wall_timeout = reader.number("wall_timeout", 0.1, 60).value_or(p.wall_timeout);
  if (const auto name = reader.text("color_by")) {
    const auto color_by = colorByName(*name);
    if (!color_by) {
      Reader::refuse("color_by", *name, "must be one of " + core::formatList(colorByNames()));
    }
    p.color_by = *color_by;
  }
  reader.warnOfUnknown();
  return p;
}

}  // namespace ball_sim
