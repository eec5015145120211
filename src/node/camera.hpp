// Where to put a camera that shows a whole scene.
#pragma once

#include <visualization_msgs/MarkerArray.h>

#include "ball_sim/vector.hpp"

namespace ball_sim {

/// A camera that looks at a point from a distance, as RViz's orbit view has it.
struct Camera {
  core::Vector3 focus = core::Vector3::Zero();  ///< m
  double distance = 1;                          ///< m, from the focus
  double yaw = 0;    ///< rad, of the camera seen from the focus, about z from x
  double pitch = 0;  ///< rad, above the horizon
};

/// An axis-aligned box that grows with what is put into it; empty at first.
class Bounds {
 public:
  Bounds();

  /// Puts in spheres, blocks (whatever their turn) and lines. The slabs of endless planes are left
  /// out: they are drawn as far as suits the rest.
  void include(const visualization_msgs::MarkerArray& markers);

  bool empty() const { return !(min_.x() <= max_.x()); }
  const core::Vector3& min() const { return min_; }  ///< m
  const core::Vector3& max() const { return max_; }  ///< m

 private:
  void include(const core::Vector3& point, double margin);

  core::Vector3 min_;
  core::Vector3 max_;
};

/// Looks at the middle, from as near as shows all corners.
/// @param bounds         not empty
/// @param yaw, pitch     rad, from where to look
/// @param field_of_view  rad, vertical
/// @param aspect         width by height of the picture
Camera cameraFor(const Bounds& bounds, double yaw, double pitch, double field_of_view,
                 double aspect);

}  // namespace ball_sim
