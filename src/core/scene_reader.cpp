// Reads a scene from YAML. Whatever it does not know, or cannot be, it refuses.
#include "ball_sim/scene_reader.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>

#include "ball_sim/ball_check.hpp"
#include "ball_sim/limits.hpp"
#include "ball_sim/methods.hpp"
#include "ball_sim/overlap_index.hpp"
#include "ball_sim/text.hpp"
#include "pi.hpp"
#include "yaml_field.hpp"

namespace ball_sim::core {
namespace {

// More than these would be a slip, and would take the machine down before anything moved.
constexpr std::size_t kMostBalls = 10'000'000;
constexpr std::size_t kMostPlanes = 1000;
constexpr std::size_t kMostFills = 1000;
constexpr std::uintmax_t kLargestFile = 1u << 30;  // bytes

// Densest packings of equal balls (Hales 2005) and discs (Thue 1910).
constexpr double kDensestSpheres = 0.74048048969306104;
constexpr double kDensestDiscs = 0.90689968211710893;

// Fifteen standard deviations: no draw of a velocity gets there.
constexpr double kMaxSigma = kMaxSpeed / 15;

// A shorter normal is zero for all that matters.
constexpr double kShortestNormal = 1e-9;

constexpr double kInf = std::numeric_limits<double>::infinity();

// --- surroundings

// One corner of the box: three numbers, each finite or open to `open_end`.
Vector3 readCorner(const YamlField& field, double open_end) {
  Vector3 corner;
  const std::vector<YamlField> entries = field.list(3);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double value = entries[axis].number();
    if (value != open_end) {
      if (!std::isfinite(value)) {
        entries[axis].fail(std::string("must be a finite number, or ") +
                           (open_end > 0 ? ".inf" : "-.inf") + " for an open face");
      }
      entries[axis].numberWithin(-kMaxCoordinate, kMaxCoordinate, " m");
    }
    corner[static_cast<Eigen::Index>(axis)] = value;
  }
  return corner;
}

Box readBox(const YamlField& field) {
  field.demandMap({"min", "max"});
  Box box;
  box.min = readCorner(field.require("min"), -kInf);
  box.max = readCorner(field.require("max"), kInf);
  for (int axis = 0; axis < 3; ++axis) {
    if (box.min[axis] < box.max[axis] || (axis == 2 && box.min[axis] == box.max[axis])) continue;
    const std::string name(1, "xyz"[axis]);
    field.require("max").fail("max " + name + " must be above min " + name + ", " +
                              formatNumber(box.min[axis]) +
                              (axis == 2 ? "" : " (only z may be equal: a planar scene)"));
  }
  return box;
}

Plane readPlane(const YamlField& field, bool planar) {
  field.demandMap({"normal", "offset"});
  Plane plane;
  const YamlField normal = field.require("normal");
  plane.normal = normal.vector(kMaxCoordinate, "");
  const double length = std::sqrt(dot(plane.normal, plane.normal));
  if (length < kShortestNormal) normal.fail("must not be of length zero");
  if (planar && plane.normal.z() != 0) {
    normal.fail("the scene is planar (box min z = max z): its z component must be 0");
  }
  if (const auto offset = field.find("offset")) {
    plane.offset = offset->numberWithin(-kMaxCoordinate, kMaxCoordinate, " m");
  }
  if (length != 1) {  // the same half-space: both sides of normal.x >= offset divided
    plane.normal /= length;
    plane.offset /= length;
  }
  if (std::abs(plane.offset) > kMaxCoordinate) {
    field.fail("the plane is further than " + formatNumber(kMaxCoordinate) + " m from the origin");
  }
  return plane;
}

void demandPeriodicIsPossible(const YamlField& periodic, const YamlField& root,
                              const Surroundings& surroundings, bool sized_by_fill) {
  if (!root.find("box")) periodic.fail("a periodic scene must have a box");
  for (int axis = 0; axis < (surroundings.planar() ? 2 : 3); ++axis) {
    if (!sized_by_fill &&
        !(std::isfinite(surroundings.box.min[axis]) && std::isfinite(surroundings.box.max[axis]))) {
      periodic.fail(
          "a periodic box must have no open face, unless a fill's packing_fraction sizes "
          "it");
    }
  }
  if (!surroundings.planes.empty()) periodic.fail("a periodic box must have no planes");
  if (surroundings.gravity != Vector3::Zero()) {
    periodic.fail("a periodic box has no bottom: gravity must be absent or zero");
  }
}

Surroundings readSurroundings(const YamlField& root) {
  Surroundings surroundings;
  if (const auto box = root.find("box")) surroundings.box = readBox(*box);
  if (const auto gravity = root.find("gravity")) {
    surroundings.gravity = gravity->vector(kMaxAcceleration, " m/s^2");
    if (surroundings.planar() && surroundings.gravity.z() != 0) {
      gravity->fail("the scene is planar (box min z = max z): its z component must be 0");
    }
  }
  if (const auto restitution = root.find("restitution")) {
    surroundings.restitution = restitution->numberWithin(0, 1, "");
  }
  if (const auto planes = root.find("planes")) {
    for (const YamlField& plane : planes->listUpTo(kMostPlanes)) {
      surroundings.planes.push_back(readPlane(plane, surroundings.planar()));
    }
  }
  if (const auto periodic = root.find("periodic")) surroundings.periodic = periodic->boolean();
  return surroundings;
}

// --- balls

Ball readBall(const YamlField& field) {
  field.demandMap({"position", "velocity", "radius", "mass"});
  Ball ball;
  ball.position = field.require("position").vector(kMaxCoordinate, " m");
  if (const auto velocity = field.find("velocity")) {
    ball.velocity = velocity->vector(kMaxSpeed, " m/s");
  }
  ball.radius = field.require("radius").positive(kMinRadius, kMaxRadius, " m");
  const YamlField mass = field.require("mass");
  ball.mass = mass.number();
  if (ball.mass != kInf) {
    if (!std::isfinite(ball.mass) || ball.mass <= 0) {
      mass.fail("must be above 0, or .inf for a fixed ball");
    }
    mass.numberWithin(kMinMass, kMaxMass, " kg");
  }
  return ball;
}

// Refuses a ball that does not fit its surroundings, at the field that is wrong.
void demandFits(const YamlField& field, const Ball& ball, const Surroundings& surroundings) {
  const Refusal refusal = checkBall(ball, surroundings);
  if (!refusal) return;
  const std::string name = refusal.reason.substr(0, refusal.reason.find(' '));
  field.find(name).value_or(field).fail(refusal.reason);
}

void demandNoOverlaps(const std::vector<YamlField>& fields, const std::vector<Ball>& balls,
                      const Surroundings& surroundings) {
  const auto overlaps = overlapsAmong(balls, std::vector<bool>(balls.size(), true), surroundings);
  for (std::size_t i = 0; i < balls.size(); ++i) {
    if (!overlaps[i]) continue;
    const Ball& other = balls[*overlaps[i]];
    const Vector3 between = separation(balls[i].position, other.position, surroundings);
    fields[i]
        .require("position")
        .fail(overlapText("balls[" + std::to_string(*overlaps[i]) + "]", between.norm(),
                          balls[i].radius + other.radius));
  }
}

// --- fill

// A number, or [min, max].
template <class ReadOne>
Range readRange(const YamlField& field, ReadOne read_one) {
  if (!field.isList()) {
    const double value = read_one(field);
    return {value, value};
  }
  const std::vector<YamlField> ends = field.list(2);
  const Range range = {read_one(ends[0]), read_one(ends[1])};
  if (range.lower > range.upper) field.fail("must be [min, max] with min not above max");
  return range;
}

double readMass(const YamlField& field) { return field.positive(kMinMass, kMaxMass, " kg"); }

void readMassOrDensity(const YamlField& field, Fill& fill) {
  const auto mass = field.find("mass");
  const auto density = field.find("density");
  if (mass && density) density->fail("mass and density must not both be given");
  if (!mass && !density) field.require("mass");
  if (density) {
    const double kg_per_m3 = density->positive(kMinMass, kMaxMass, " kg/m^3");
    const auto mass_of = [&](double r) { return kg_per_m3 * (4.0 / 3.0 * kPi) * r * r * r; };
    if (mass_of(fill.radius.lower) < kMinMass || mass_of(fill.radius.upper) > kMaxMass) {
      density->fail("makes masses beyond " + formatNumber(kMinMass) + ".." +
                    formatNumber(kMaxMass) + " kg");
    }
    fill.density = kg_per_m3;
  } else if (!mass->isList() && mass->number() == kInf) {
    fill.mass = Range{kInf, kInf};  // fixed obstacles
  } else {
    fill.mass = readRange(*mass, readMass);
  }
}

Fill readFill(const YamlField& field, bool planar) {
  field.demandMap(
      {"count", "radius", "mass", "density", "speed_sigma", "seed", "packing_fraction"});
  Fill fill;
  fill.count = field.require("count").wholeNumber(1, kMostBalls);
  fill.radius = readRange(field.require("radius"), [](const YamlField& radius) {
    return radius.positive(kMinRadius, kMaxRadius, " m");
  });
  readMassOrDensity(field, fill);
  if (const auto sigma = field.find("speed_sigma")) {
    fill.speed_sigma = sigma->numberWithin(0, kMaxSigma, " m/s");
  }
  if (const auto seed = field.find("seed")) {
    fill.seed = seed->wholeNumber(0, std::numeric_limits<std::uint64_t>::max());
  }
  if (const auto fraction = field.find("packing_fraction")) {
    const double densest = planar ? kDensestDiscs : kDensestSpheres;
    fill.packing_fraction = fraction->positive(1e-30, densest, " (the densest packing there is)");
  }
  return fill;
}

bool openExtent(const Surroundings& surroundings) {
  for (int axis = 0; axis < (surroundings.planar() ? 2 : 3); ++axis) {
    if (std::isinf(surroundings.box.min[axis]) || std::isinf(surroundings.box.max[axis])) {
      return true;
    }
  }
  return false;
}

// The box must be finite, or one packing fraction must size it.
// @return whether it does
bool checkFillsTogether(const std::vector<YamlField>& fields, const Scene& scene) {
  std::optional<double> fraction;
  std::size_t count = scene.balls.size();
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const Fill& fill = scene.fill[i];
    count += fill.count;
    if (count > kMostBalls) {
      fields[i].require("count").fail("a scene must have at most " + std::to_string(kMostBalls) +
                                      " balls");
    }
    if (!fill.packing_fraction) continue;
    const YamlField field = fields[i].require("packing_fraction");
    if (!openExtent(scene.surroundings)) {
      field.fail("sizes the open extents of the box, and this box has none");
    }
    if (fraction && *fraction != *fill.packing_fraction) {
      field.fail("a scene has one packing fraction, and it was " + formatNumber(*fraction) +
                 " before");
    }
    fraction = fill.packing_fraction;
  }
  if (!fields.empty() && !fraction && openExtent(scene.surroundings)) {
    fields[0].fail("needs a box without open faces, or a packing_fraction that sizes it");
  }
  return fraction.has_value();
}

// --- how to run it

void readMethod(const YamlField& root, Scene& scene) {
  if (const auto method = root.find("method")) {
    scene.method = method->text();
    const std::vector<std::string>& names = methodNames();
    if (std::find(names.begin(), names.end(), scene.method) == names.end()) {
      std::string list;
      for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
      method->fail("must be one of " + list);
    }
  }
  if (const auto time_step = root.find("time_step")) {
    scene.time_step = time_step->positive(1e-15, kMaxTime, " s");
  }
  if (const auto tolerance = root.find("tolerance")) {
    scene.tolerance = tolerance->positive(1e-300, 1, " of a radius");
  }
  if (const auto impacts = root.find("simultaneous_impacts")) {
    const std::string policy = impacts->text();
    if (policy == "simultaneous") {
      scene.simultaneous_impacts = SimultaneousImpacts::simultaneous;
    } else if (policy != "sequential") {
      impacts->fail("must be sequential or simultaneous");
    }
  }
}

Scene readRoot(const YamlField& root) {
  root.demandMap({"name", "gravity", "restitution", "box", "periodic", "planes", "balls", "fill",
                  "method", "time_step", "tolerance", "simultaneous_impacts"});
  Scene scene;
  if (const auto name = root.find("name")) scene.name = name->text();
  scene.surroundings = readSurroundings(root);
  std::vector<YamlField> balls;
  if (const auto field = root.find("balls")) balls = field->listUpTo(kMostBalls);
  for (const YamlField& ball : balls) scene.balls.push_back(readBall(ball));
  std::vector<YamlField> fills;
  if (const auto field = root.find("fill")) fills = field->listUpTo(kMostFills);
  for (const YamlField& fill : fills) {
    scene.fill.push_back(readFill(fill, scene.surroundings.planar()));
  }
  const bool sized_by_fill = checkFillsTogether(fills, scene);
  const auto periodic = root.find("periodic");
  if (scene.surroundings.periodic) {
    demandPeriodicIsPossible(*periodic, root, scene.surroundings, sized_by_fill);
  }
  for (std::size_t i = 0; i < balls.size(); ++i) {
    demandFits(balls[i], scene.balls[i], scene.surroundings);
  }
  // Where a fill sizes a periodic box, its images are known only once it has its size.
  if (!(scene.surroundings.periodic && sized_by_fill)) {
    demandNoOverlaps(balls, scene.balls, scene.surroundings);
  }
  readMethod(root, scene);
  return scene;
}

std::string readFile(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    throw SceneError(path + ": cannot be read: it is a folder");
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) throw SceneError(path + ": cannot be read: " + std::strerror(errno));
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (!error && size > kLargestFile) {
    throw SceneError(path + ": cannot be read: larger than " + std::to_string(kLargestFile) +
                     " bytes");
  }
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace

Scene readScene(const std::string& path) { return parseScene(readFile(path), path); }

Scene parseScene(const std::string& text, const std::string& source) {
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(text);
    if (documents.empty() || documents[0].IsNull()) {
      throw SceneError(source + ":1: scene: nothing: the file must hold a scene");
    }
    if (documents.size() > 1) {
      YamlField(source, "", documents[1]).fail("a file must hold one scene, not several");
    }
    return readRoot(YamlField(source, "", documents[0]));
  } catch (const YAML::Exception& error) {
    throw SceneError(source + ":" + std::to_string(std::max(error.mark.line, 0) + 1) +
                     ": scene: not YAML: " + error.msg);
  }
}

}  // namespace ball_sim::core
