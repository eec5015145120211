#include "coloring.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace ball_sim {
namespace {

using Color = std_msgs::ColorRGBA;

Color rgb(double red, double green, double blue) {
  Color color;
  color.r = static_cast<float>(red);
  color.g = static_cast<float>(green);
  color.b = static_cast<float>(blue);
  color.a = 1;
  return color;
}

/// Colour of full value. @param hue  0..1: red, yellow, green, cyan, blue, magenta, red
Color fromHue(double hue, double saturation, double value) {
  const auto channel = [&](double shift) {
    const double position = std::fmod(hue + shift, 1.0) * 6;
    const double pure = std::clamp(std::abs(position - 3) - 1, 0.0, 1.0);
    return value * (1 - saturation * (1 - pure));
  };
  return rgb(channel(0), channel(2.0 / 3), channel(1.0 / 3));
}

/// The first balls get colours that people tell apart at a glance, as on a pool table.
constexpr std::array<std::array<double, 3>, 16> kFirstColors{{{0.96, 0.95, 0.90},
                                                              {1.00, 0.78, 0.05},
                                                              {0.10, 0.30, 0.90},
                                                              {0.90, 0.10, 0.12},
                                                              {0.45, 0.15, 0.65},
                                                              {1.00, 0.45, 0.05},
                                                              {0.00, 0.75, 0.65},
                                                              {0.55, 0.08, 0.15},
                                                              {0.10, 0.10, 0.12},
                                                              {1.00, 0.93, 0.45},
                                                              {0.40, 0.65, 1.00},
                                                              {1.00, 0.45, 0.50},
                                                              {0.75, 0.50, 0.95},
                                                              {1.00, 0.70, 0.40},
                                                              {0.55, 1.00, 0.75},
                                                              {0.95, 0.35, 0.75}}};

Color idColor(core::BallId id) {
  if (id < kFirstColors.size()) {
    const auto& c = kFirstColors[id];
    return rgb(c[0], c[1], c[2]);
  }
  // Steps of the golden ratio never come near an earlier hue too soon.
  constexpr double kGoldenStep = 0.6180339887498949;
  const double saturation = id % 2 == 0 ? 0.85 : 0.6;
  return fromHue(std::fmod(id * kGoldenStep, 1.0), saturation, 0.95);
}

/// @param share  0..1: blue to red
Color rampColor(double share) { return fromHue((1 - std::clamp(share, 0.0, 1.0)) * 2 / 3, 0.9, 1); }

std::vector<Color> rampColors(const std::vector<double>& values) {
  double lowest = std::numeric_limits<double>::infinity();
  double highest = 0;
  for (const double value : values) {
    if (std::isfinite(value)) {
      lowest = std::min(lowest, value);
      highest = std::max(highest, value);
    }
  }
  const double range = std::log(highest / lowest);
  std::vector<Color> colors;
  colors.reserve(values.size());
  for (const double value : values) {
    colors.push_back(rampColor(range > 0 ? std::log(value / lowest) / range : 0));
  }
  return colors;
}

}  // namespace

const std::vector<std::string>& colorByNames() {
  static const std::vector<std::string> names{"id", "speed", "radius", "mass"};
  return names;
}

std::optional<ColorBy> colorByName(const std::string& name) {
  const auto& names = colorByNames();
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? std::nullopt
                              : std::optional(static_cast<ColorBy>(found - names.begin()));
}

std::vector<Color> lastingColors(ColorBy color_by, const std::vector<core::BallId>& ids,
                                 const std::vector<double>& radii,
                                 const std::vector<double>& masses) {
  std::vector<Color> colors;
  if (color_by == ColorBy::radius) {
    colors = rampColors(radii);
  } else if (color_by == ColorBy::mass) {
    colors = rampColors(masses);
  } else {
    colors.resize(ids.size());
    std::transform(ids.begin(), ids.end(), colors.begin(), idColor);
  }
  for (std::size_t i = 0; i < masses.size(); ++i) {
    if (std::isinf(masses[i])) {
      colors[i] = rgb(0.45, 0.45, 0.45);
    }
  }
  return colors;
}

void speedColors(const std::vector<core::Vector3>& velocities, std::vector<Color>& colors) {
  double sum = 0;
  for (const core::Vector3& velocity : velocities) {
    sum += core::dot(velocity, velocity);
  }
  const double full_speed =
      2 * std::sqrt(sum / static_cast<double>(std::max<std::size_t>(velocities.size(), 1)));
  colors.clear();
  for (const core::Vector3& velocity : velocities) {
    colors.push_back(
        rampColor(full_speed > 0 ? std::sqrt(core::dot(velocity, velocity)) / full_speed : 0));
  }
}

}  // namespace ball_sim
