#include "scene_markers.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "conversions.hpp"

namespace ball_sim {
namespace {

using visualization_msgs::Marker;

std_msgs::ColorRGBA rgba(float red, float green, float blue, float alpha = 1) {
  std_msgs::ColorRGBA color;
  color.r = red;
  color.g = green;
  color.b = blue;
  color.a = alpha;
  return color;
}

const std_msgs::ColorRGBA kCloth = rgba(0.06F, 0.58F, 0.34F);
const std_msgs::ColorRGBA kCushion = rgba(0.05F, 0.50F, 0.29F);
const std_msgs::ColorRGBA kWood = rgba(0.50F, 0.27F, 0.13F);
const std_msgs::ColorRGBA kFloor = rgba(0.70F, 0.73F, 0.78F);
const std_msgs::ColorRGBA kWall = rgba(0.45F, 0.50F, 0.55F, 0.35F);
const std_msgs::ColorRGBA kEdge = rgba(0.75F, 0.78F, 0.82F);

/// Axis-aligned, finite.
struct Extent {
  core::Vector3 min;
  core::Vector3 max;

  core::Vector3 centre() const { return (min + max) / 2; }
  core::Vector3 size() const { return max - min; }
};

/// What balls and closed faces span.
Extent extentOf(const core::Surroundings& surroundings, const core::BallStates& balls,
                const std::vector<double>& radii) {
  Extent extent{core::Vector3::Constant(std::numeric_limits<double>::infinity()),
                core::Vector3::Constant(-std::numeric_limits<double>::infinity())};
  const auto include = [&](int axis, double value) {
    extent.min[axis] = std::min(extent.min[axis], value);
    extent.max[axis] = std::max(extent.max[axis], value);
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < radii.size(); ++i) {
      include(axis, balls.positions[i][axis] - radii[i]);
      include(axis, balls.positions[i][axis] + radii[i]);
    }
    for (const double face : {surroundings.box.min[axis], surroundings.box.max[axis]}) {
      if (std::isfinite(face)) {
        include(axis, face);
      }
    }
    if (!(extent.min[axis] <= extent.max[axis])) {  // nothing there at all
      include(axis, -1);
      include(axis, 1);
    }
  }
  return extent;
}

/// Collects the markers of one scene.
class Builder {
 public:
  Builder(const core::Surroundings& surroundings, const core::BallStates& balls,
          const std::vector<double>& radii, std::string frame_id)
      : surroundings_(surroundings),
        extent_(extentOf(surroundings, balls, radii)),
        frame_id_(std::move(frame_id)) {
    largest_radius_ = radii.empty() ? 0.05 : *std::max_element(radii.begin(), radii.end());
    table_ = tableArea();
  }

  visualization_msgs::MarkerArray build() {
    if (surroundings_.planar()) {
      addTable();
      addCushions();
    } else {
      addFloor();
      addEdges();
    }
    for (const core::Plane& plane : surroundings_.planes) {
      addPlane(plane);
    }
    return std::move(array_);
  }

 private:
  Marker& add(int type, const std::string& name, const std_msgs::ColorRGBA& color) {
    Marker marker;
    marker.header.frame_id = frame_id_;
    marker.ns = name;
    marker.id = static_cast<int>(array_.markers.size());
    marker.type = type;
    marker.action = Marker::ADD;
    marker.pose.orientation.w = 1;
    marker.color = color;
    array_.markers.push_back(marker);
    return array_.markers.back();
  }

  Marker& addBlock(const std::string& name, const std_msgs::ColorRGBA& color,
                   const core::Vector3& centre, const core::Vector3& size) {
    Marker& marker = add(Marker::CUBE, name, color);
    marker.pose.position = toPoint(centre);
    marker.scale = toVector(size);
    return marker;
  }

  bool closed(int axis, bool upper) const {
    const core::Box& box = surroundings_.box;
    return !surroundings_.periodic && std::isfinite(upper ? box.max[axis] : box.min[axis]);
  }

  double tableTop() const { return surroundings_.box.min.z() - largest_radius_; }

  double longerSide() const { return std::max(extent_.size().x(), extent_.size().y()); }

  double tableThickness() const { return 0.02 * longerSide(); }

  /// As wide as cushions look right, m.
  double cushionWidth() const {
    return std::clamp(largest_radius_, 0.02 * longerSide(), 0.04 * longerSide());
  }

  /// The playing area. An open side gets a margin, so that balls do not start on the edge.
  Extent tableArea() const {
    Extent area = extent_;
    for (int axis = 0; axis < 2; ++axis) {
      const double margin = 0.5 * std::max(extent_.size()[axis], 0.4 * longerSide());
      area.min[axis] -= closed(axis, false) || surroundings_.periodic ? 0 : margin;
      area.max[axis] += closed(axis, true) || surroundings_.periodic ? 0 : margin;
    }
    return area;
  }

  void addTable() {
    const double thickness = tableThickness();
    addBlock("table", kCloth,
             {table_.centre().x(), table_.centre().y(), tableTop() - thickness / 2},
             {table_.size().x(), table_.size().y(), thickness});
  }

  void addCushions() {
    for (int axis = 0; axis < 2; ++axis) {
      for (const bool upper : {false, true}) {
        if (closed(axis, upper)) {
          addCushion(axis, upper);
          addRail(axis, upper);
        }
      }
    }
  }

  /// As high as real cushions touch the ball, m.
  double cushionHeight() const { return 1.3 * largest_radius_; }

  /// A slope that rises outwards from a closed face, mitred at its ends. RViz lights what faces the
  /// viewer: upright cushions would look black.
  void addCushion(int axis, bool upper) {
    const int along = 1 - axis;
    const double width = cushionWidth();
    const auto corner = [&](double end, double outwards) {
      core::Vector3 point;
      point[axis] = upper ? table_.max[axis] + outwards : table_.min[axis] - outwards;
      point[along] = end;
      point.z() = tableTop() + cushionHeight() * outwards / width;
      return point;
    };
    const double low = table_.min[along];
    const double high = table_.max[along];
    std::array<core::Vector3, 4> corners{corner(low, 0), corner(high, 0),
                                         corner(high + width, width), corner(low - width, width)};
    if ((corners[1] - corners[0]).cross(corners[2] - corners[0]).z() < 0) {
      std::reverse(corners.begin(), corners.end());  // counter-clockwise seen from above
    }
    Marker& marker = add(Marker::TRIANGLE_LIST, "cushions", kCushion);
    marker.scale.x = marker.scale.y = marker.scale.z = 1;
    for (const std::size_t i : {0, 1, 2, 0, 2, 3}) {
      marker.points.push_back(toPoint(corners[i]));
    }
  }

  /// The wood behind a cushion.
  void addRail(int axis, bool upper) {
    const int along = 1 - axis;
    const double offset = cushionWidth();
    const double width = 1.6 * offset;
    const double top = tableTop() + 1.1 * cushionHeight();
    const double bottom = tableTop() - tableThickness();
    core::Vector3 centre = table_.centre();
    centre[axis] =
        upper ? table_.max[axis] + offset + width / 2 : table_.min[axis] - offset - width / 2;
    centre.z() = (top + bottom) / 2;
    core::Vector3 size;
    size[axis] = width;
    size[along] = table_.size()[along] + 2 * offset + (axis == 0 ? 2 * width : 0);
    size.z() = top - bottom;
    addBlock("rails", kWood, centre, size);
  }

  void addFloor() {
    const double bottom = surroundings_.box.min.z();
    if (!std::isfinite(bottom)) {
      return;
    }
    const double thickness = 0.01 * longerSide();
    addBlock("floor", kFloor, {extent_.centre().x(), extent_.centre().y(), bottom - thickness / 2},
             {extent_.size().x(), extent_.size().y(), thickness});
  }

  /// The edges of the box between finite corners.
  void addEdges() {
    const core::Box& box = surroundings_.box;
    std::vector<geometry_msgs::Point> points;
    for (int axis = 0; axis < 3; ++axis) {
      const int u = (axis + 1) % 3;
      const int v = (axis + 2) % 3;
      for (const double at_u : {box.min[u], box.max[u]}) {
        for (const double at_v : {box.min[v], box.max[v]}) {
          if (std::isfinite(at_u) && std::isfinite(at_v)) {
            core::Vector3 end;
            end[u] = at_u;
            end[v] = at_v;
            end[axis] = extent_.min[axis];
            points.push_back(toPoint(end));
            end[axis] = extent_.max[axis];
            points.push_back(toPoint(end));
          }
        }
      }
    }
    if (!points.empty()) {  // an empty list is an error in RViz
      Marker& marker = add(Marker::LINE_LIST, "box", kEdge);
      marker.points = std::move(points);
      marker.scale.x = 0.003 * extent_.size().maxCoeff();
    }
  }

  /// A slab behind the plane. Floors are opaque; walls and ceilings let the balls be seen.
  void addPlane(const core::Plane& plane) {
    const double length = 1.5 * extent_.size().maxCoeff();
    const double thickness = 0.01 * length;
    const core::Vector3 middle = extent_.centre();
    const double inside = core::dot(plane.normal, middle) - plane.offset;  // m from the plane
    core::Vector3 centre = middle - plane.normal * (inside + thickness / 2);
    core::Vector3 size{length, length, thickness};
    std_msgs::ColorRGBA color = plane.normal.z() > 0.1 ? kFloor : kWall;
    Eigen::Quaterniond turn =
        Eigen::Quaterniond::FromTwoVectors(core::Vector3::UnitZ(), plane.normal);
    if (surroundings_.planar()) {  // a low wall on the table, its x axis upright
      size.x() = 3 * largest_radius_;
      centre.z() = tableTop() + size.x() / 2;
      color = kWood;
      Eigen::Matrix3d axes;
      axes << core::Vector3::UnitZ(), plane.normal.cross(core::Vector3::UnitZ()), plane.normal;
      turn = axes;
    }
    Marker& marker = addBlock("planes", color, centre, size);
    marker.pose.orientation.x = turn.x();
    marker.pose.orientation.y = turn.y();
    marker.pose.orientation.z = turn.z();
    marker.pose.orientation.w = turn.w();
  }

  const core::Surroundings& surroundings_;
  const Extent extent_;
  const std::string frame_id_;
  double largest_radius_ = 0;  // m
  Extent table_;               // of a planar scene
  visualization_msgs::MarkerArray array_;
};

}  // namespace

visualization_msgs::MarkerArray sceneMarkers(const core::Surroundings& surroundings,
                                             const core::BallStates& balls,
                                             const std::vector<double>& radii,
                                             const std::string& frame_id) {
  return Builder(surroundings, balls, radii, frame_id).build();
}

}  // namespace ball_sim
