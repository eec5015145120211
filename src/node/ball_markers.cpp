#include "ball_markers.hpp"

#include <algorithm>
#include <cmath>

#include "coloring.hpp"
#include "conversions.hpp"

namespace ball_sim {
namespace {

using visualization_msgs::Marker;

constexpr std::size_t kMaxClasses = 100;

/// The radii to draw, ascending: all that occur, or kMaxClasses steps between the extremes.
std::vector<double> drawnRadii(std::vector<double> radii) {
  std::sort(radii.begin(), radii.end());
  radii.erase(std::unique(radii.begin(), radii.end()), radii.end());
  if (radii.size() <= kMaxClasses) {
    return radii;
  }
  const double step = std::log(radii.back() / radii.front()) / (kMaxClasses - 1);
  std::vector<double> steps;
  for (std::size_t i = 0; i < kMaxClasses; ++i) {
    steps.push_back(radii.front() * std::exp(step * static_cast<double>(i)));
  }
  return steps;
}

/// Index of the nearest drawn radius, by ratio.
std::size_t nearestClass(const std::vector<double>& drawn, double radius) {
  const auto above = std::lower_bound(drawn.begin(), drawn.end(), radius);
  const auto index = static_cast<std::size_t>(above - drawn.begin());
  if (index == 0) {
    return 0;
  }
  const bool below_is_nearer =
      above == drawn.end() || radius / drawn[index - 1] < drawn[index] / radius;
  return below_is_nearer ? index - 1 : index;
}

Marker makeMarker(int id) {
  Marker marker;
  marker.ns = "balls";
  marker.id = id;
  marker.type = Marker::SPHERE_LIST;
  marker.pose.orientation.w = 1;
  marker.color.a = 1;
  return marker;
}

}  // namespace

void BallMarkers::setBalls(const std::vector<double>& radii,
                           const std::vector<std_msgs::ColorRGBA>& colors) {
  const std::vector<double> drawn = drawnRadii(radii);
  for (auto id = array_.markers.size(); id < drawn.size(); ++id) {
    array_.markers.push_back(makeMarker(static_cast<int>(id)));
  }
  std::vector<std::size_t> counts(array_.markers.size(), 0);
  class_of_.clear();
  place_of_.clear();
  for (const double radius : radii) {
    const std::size_t index = nearestClass(drawn, radius);
    class_of_.push_back(index);
    place_of_.push_back(counts[index]++);
  }
  for (std::size_t i = 0; i < array_.markers.size(); ++i) {
    Marker& marker = array_.markers[i];
    marker.action = counts[i] > 0 ? Marker::ADD : Marker::DELETE;
    marker.points.resize(counts[i]);
    marker.colors.resize(counts[i]);
    const double diameter = i < drawn.size() ? 2 * drawn[i] : 0;
    marker.scale.x = marker.scale.y = marker.scale.z = diameter;
  }
  setColors(colors);
}

const visualization_msgs::MarkerArray& BallMarkers::update(const core::BallStates& states,
                                                           const std_msgs::Header& header) {
  for (Marker& marker : array_.markers) {
    marker.header = header;
  }
  for (std::size_t i = 0; i < states.positions.size(); ++i) {
    markerOf(i).points[place_of_[i]] = toPoint(states.positions[i]);
  }
  if (by_speed_) {
    speedColors(states.velocities, changing_);
    setColors(changing_);
  }
  return array_;
}

void BallMarkers::setColors(const std::vector<std_msgs::ColorRGBA>& colors) {
  for (std::size_t i = 0; i < colors.size(); ++i) {
    markerOf(i).colors[place_of_[i]] = colors[i];
  }
}

}  // namespace ball_sim
