#include "camera.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "conversions.hpp"

namespace ball_sim {

using visualization_msgs::Marker;

Bounds::Bounds()
    : min_(core::Vector3::Constant(std::numeric_limits<double>::infinity())), max_(-min_) {}

void Bounds::include(const visualization_msgs::MarkerArray& markers) {
  for (const Marker& marker : markers.markers) {
    if (marker.action != Marker::ADD || marker.ns == "planes") {
      continue;
    }
    const bool spheres = marker.type == Marker::SPHERE_LIST;
    for (const geometry_msgs::Point& point : marker.points) {
      include(fromMessage(point), spheres ? marker.scale.x / 2 : 0);
    }
    if (marker.type == Marker::CUBE) {
      const core::Vector3 centre = fromMessage(marker.pose.position);
      const core::Vector3 half = fromMessage(marker.scale) / 2;
      include(centre - half, 0);
      include(centre + half, 0);
    }
  }
}

void Bounds::include(const core::Vector3& point, double margin) {
  min_ = min_.cwiseMin(point - core::Vector3::Constant(margin));
  max_ = max_.cwiseMax(point + core::Vector3::Constant(margin));
}

Camera cameraFor(const Bounds& bounds, double yaw, double pitch, double field_of_view,
                 double aspect) {
  const core::Vector3 forward(-std::cos(yaw) * std::cos(pitch), -std::sin(yaw) * std::cos(pitch),
                              -std::sin(pitch));
  const core::Vector3 right = forward.cross(core::Vector3::UnitZ()).normalized();
  const core::Vector3 up = right.cross(forward);
  const double half_height = std::tan(field_of_view / 2);  // of the picture, at distance 1

  Camera camera;
  camera.focus = (bounds.min() + bounds.max()) / 2;
  camera.yaw = yaw;
  camera.pitch = pitch;
  camera.distance = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    core::Vector3 offset = bounds.max() - camera.focus;
    for (unsigned axis = 0; axis < 3; ++axis) {
      if ((corner >> axis & 1U) != 0) {
        offset[axis] = -offset[axis];
      }
    }
    const double side = std::max(std::abs(core::dot<double>(offset, right)) / aspect,
                                 std::abs(core::dot<double>(offset, up)));
    camera.distance =
        std::max(camera.distance, side / half_height - core::dot<double>(offset, forward));
  }
  return camera;
}

}  // namespace ball_sim
