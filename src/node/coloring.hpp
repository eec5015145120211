// Which colour a ball has on the screen.
#pragma once

#include <std_msgs/ColorRGBA.h>

#include <optional>
#include <string>
#include <vector>

#include "ball_sim/ball.hpp"

namespace ball_sim {

/// What a ball's colour tells.
enum class ColorBy { id, speed, radius, mass };

/// The names that colorByName() knows.
const std::vector<std::string>& colorByNames();

/// @return nothing for an unknown name
std::optional<ColorBy> colorByName(const std::string& name);

/// Colours that stay as long as the balls do.
///
/// By id: distinct colours, ball 0 white. By radius or mass: from blue (the smallest present) to
/// red (the largest), evenly in the logarithm. Fixed balls are grey. By speed: as by id, as speeds
/// change; see speedColors().
/// @param radii   m, one a ball in the order of `ids`
/// @param masses  kg, the same
std::vector<std_msgs::ColorRGBA> lastingColors(ColorBy color_by,
                                               const std::vector<core::BallId>& ids,
                                               const std::vector<double>& radii,
                                               const std::vector<double>& masses);

/// From blue (at rest) to red (twice the root mean square speed of the moment, or more).
/// @param velocities  m/s
/// @param colors      one a ball; reuses its memory
void speedColors(const std::vector<core::Vector3>& velocities,
                 std::vector<std_msgs::ColorRGBA>& colors);

}  // namespace ball_sim
