// The scene format: what it reads, and that each mistake is refused at its line with its key.
#include "ball_sim/scene_reader.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <string>

namespace ball_sim::core {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

std::string refusalOf(const std::string& text) {
  try {
    parseScene(text, "scene.yaml");
  } catch (const SceneError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(SceneReader, ReadsEverything) {
  const Scene scene = parseScene(R"(
name: all of it
gravity: [0, 0, -9.81]
restitution: 0.5
box: {min: [-1, -2, 0], max: [1, .inf, 3]}
planes: [{normal: [0, 3, 4], offset: -10}, {normal: [1, 0, 0], offset: -0.5}]
balls:
  - {position: [0, 0, 1], velocity: [1, 0, 0], radius: 0.05, mass: 1}
  - {position: [0, 1, 1], radius: 0.25, mass: .inf}
fill:
  - {count: 10, radius: [0.01, 0.02], mass: [1, 2], speed_sigma: 1.5, seed: 18446744073709551615, packing_fraction: 0.1}
  - {count: 5, radius: 0.05, density: 1e3}
method: event_driven
time_step: 1e-3
tolerance: 1e-6
simultaneous_impacts: sequential
)",
                                 "scene.yaml");
  EXPECT_EQ(scene.name, "all of it");
  const Surroundings& around = scene.surroundings;
  EXPECT_EQ(around.gravity, Vector3(0, 0, -9.81));
  EXPECT_EQ(around.restitution, 0.5);
  EXPECT_EQ(around.box.min, Vector3(-1, -2, 0));
  EXPECT_EQ(around.box.max, Vector3(1, kInf, 3));
  EXPECT_FALSE(around.periodic);
  ASSERT_EQ(around.planes.size(), 2u);
  // Normalised, and still the same half-space: 3 y + 4 z >= -10.
  EXPECT_EQ(around.planes[0].normal, Vector3(0, 0.6, 0.8));
  EXPECT_EQ(around.planes[0].offset, -2);
  ASSERT_EQ(scene.balls.size(), 2u);
  EXPECT_EQ(scene.balls[0].velocity, Vector3(1, 0, 0));
  EXPECT_EQ(scene.balls[1].velocity, Vector3(0, 0, 0));
  EXPECT_EQ(scene.balls[1].radius, 0.25);
  EXPECT_EQ(scene.balls[1].mass, kInf);
  ASSERT_EQ(scene.fill.size(), 2u);
  EXPECT_EQ(scene.fill[0].count, 10u);
  EXPECT_EQ(scene.fill[0].radius.upper, 0.02);
  EXPECT_EQ(scene.fill[0].mass->lower, 1);
  EXPECT_EQ(scene.fill[0].speed_sigma, 1.5);
  EXPECT_EQ(scene.fill[0].seed, std::numeric_limits<std::uint64_t>::max());
  EXPECT_EQ(scene.fill[0].packing_fraction, 0.1);
  EXPECT_EQ(scene.fill[1].density, 1000);
  EXPECT_EQ(scene.fill[1].radius.lower, scene.fill[1].radius.upper);
  EXPECT_FALSE(scene.fill[1].mass);
  EXPECT_EQ(scene.method, "event_driven");
  EXPECT_EQ(scene.time_step, 1e-3);
  EXPECT_EQ(scene.tolerance, 1e-6);
}

TEST(SceneReader, AbsentIsNotModelled) {
  const Scene scene = parseScene("name: empty space", "scene.yaml");
  EXPECT_EQ(scene.surroundings.gravity, Vector3(0, 0, 0));
  EXPECT_EQ(scene.surroundings.restitution, 1);
  EXPECT_EQ(scene.surroundings.box.max, Vector3(kInf, kInf, kInf));
  EXPECT_FALSE(scene.surroundings.planar());
  EXPECT_TRUE(scene.balls.empty());
  EXPECT_EQ(scene.method, "auto");
  EXPECT_FALSE(scene.tolerance);
}

TEST(SceneReader, PeriodicAndPlanar) {
  EXPECT_TRUE(parseScene("box: {min: [0, 0, 0], max: [1, 1, 1]}\nperiodic: true", "s")
                  .surroundings.periodic);
  EXPECT_TRUE(parseScene("box: {min: [0, 0, 2], max: [1, 1, 2]}\nperiodic: true", "s")
                  .surroundings.planar());
}

TEST(SceneReader, TouchingBallsAreAllowed) {
  EXPECT_EQ(refusalOf("balls:\n"
                      "  - {position: [0, 0, 0], radius: 0.1, mass: 1}\n"
                      "  - {position: [0.3, 0, 0], radius: 0.2, mass: 1}\n"),
            "accepted");
}

TEST(SceneReader, MessagesAreWhole) {
  EXPECT_EQ(refusalOf("balls:\n  - {position: [0, 0, 0], radius: -1, mass: 1}"),
            "scene.yaml:2: balls[0].radius: -1: must be a finite number above 0");
  EXPECT_EQ(refusalOf("balls:\n  - {position: [0, 0, 0],\n     raduis: 1, mass: 1}"),
            "scene.yaml:3: balls[0].raduis: 1: unknown key, did you mean 'radius'? (known: "
            "position, velocity, radius, mass)");
  EXPECT_EQ(refusalOf("\nbox: {min: [0, 0, 0], max: [1, 1, 1]}\nballs:\n"
                      "  - {position: [0.5, 0.5, 0.5], radius: 0.1, mass: 1}\n"
                      "  - {position: [0.5, 0.65, 0.5], radius: 0.1, mass: 1}\n"),
            "scene.yaml:5: balls[1].position: [0.5, 0.65, 0.5]: overlaps balls[0]: centres 0.15 m "
            "apart, radii sum to 0.2 m");
  EXPECT_EQ(refusalOf("restitution: 2"), "scene.yaml:1: restitution: 2: must be within 0..1");
}

// A mistake, and what its refusal must say: line and key, and a word of the rule.
struct Mistake {
  std::string text;
  std::string where;
  std::string rule;
};

class SceneMistake : public testing::TestWithParam<Mistake> {};

TEST_P(SceneMistake, IsRefused) {
  const std::string refusal = refusalOf(GetParam().text);
  EXPECT_EQ(refusal.find("scene.yaml:" + GetParam().where + ": "), 0u) << refusal;
  EXPECT_NE(refusal.find(GetParam().rule), std::string::npos) << refusal;
}

std::string ball(const std::string& fields) { return "balls:\n  - {" + fields + "}\n"; }
std::string fill(const std::string& fields) {
  return "box: {min: [0, 0, 0], max: [1, 1, 1]}\nfill:\n  - {" + fields + "}\n";
}

INSTANTIATE_TEST_SUITE_P(File, SceneMistake,
                         testing::Values(Mistake{"", "1: scene", "must hold a scene"},
                                         Mistake{"# nothing\n", "1: scene", "must hold a scene"},
                                         Mistake{"- 1\n- 2\n", "1: scene", "must be a map"},
                                         Mistake{"just text", "1: scene", "must be a map"},
                                         Mistake{"name: a\nbox: {min: [0", "2: scene", "not YAML"},
                                         Mistake{"name: a\n---\nname: b\n", "3: scene",
                                                 "not several"},
                                         Mistake{"name: a\nname: b\n", "2: name", "twice"},
                                         Mistake{"[1, 2]: 3\n", "1: scene", "plain text"},
                                         Mistake{"colour: red\n", "1: colour", "unknown key"},
                                         Mistake{"name: [a]\n", "1: name", "must be text"}));

INSTANTIATE_TEST_SUITE_P(
    Surroundings, SceneMistake,
    testing::Values(
        Mistake{"gravity: -9.81", "1: gravity", "list of 3"},
        Mistake{"gravity: [0, 0]", "1: gravity", "list of 3"},
        Mistake{"gravity: [0, 0, .nan]", "1: gravity[2]", "within"},
        Mistake{"gravity: [0, 0, '1']", "1: gravity[2]", "must be a number"},
        Mistake{"gravity: [0, 0, 1e10]", "1: gravity[2]", "within"},
        Mistake{"gravity:", "1: gravity", "list of 3"},
        Mistake{"restitution: 1.1", "1: restitution", "0..1"},
        Mistake{"restitution: -0.1", "1: restitution", "0..1"},
        Mistake{"restitution: .nan", "1: restitution", "0..1"},
        Mistake{"restitution: high", "1: restitution", "must be a number"},
        Mistake{"restitution: 1e", "1: restitution", "must be a number"},
        Mistake{"restitution: 0x1", "1: restitution", "must be a number"},
        Mistake{"restitution: 1e999", "1: restitution", "must be a number"},
        Mistake{"box: 3", "1: box", "must be a map"},
        Mistake{"box: {min: [0, 0, 0]}", "1: box.max", "required"},
        Mistake{"box: {min: [0, 0, 0], max: [1, 1, -1]}", "1: box.max", "max z"},
        Mistake{"box: {min: [0, 1, 0], max: [1, 1, 1]}", "1: box.max", "max y"},
        Mistake{"box: {min: [.inf, 0, 0], max: [1, 1, 1]}", "1: box.min[0]", "-.inf"},
        Mistake{"box: {min: [0, 0, 0], max: [1, .nan, 1]}", "1: box.max[1]", ".inf"},
        Mistake{"box: {min: [0, 0, 0], max: [1, 1e300, 1]}", "1: box.max[1]", "within"},
        Mistake{"periodic: true", "1: periodic", "must have a box"},
        Mistake{"periodic: yes", "1: periodic", "true or false"},
        Mistake{"box: {min: [0, 0, 0], max: [1, 1, .inf]}\nperiodic: true", "2: periodic", "open"},
        Mistake{"box: {min: [0, 0, 0], max: [1, 1, 1]}\nperiodic: true\ngravity: [0, 0, -1]",
                "2: periodic", "gravity"},
        Mistake{"box: {min: [0, 0, 0], max: [1, 1, 1]}\nperiodic: true\n"
                "planes: [{normal: [0, 0, 1]}]",
                "2: periodic", "planes"},
        Mistake{"planes: {normal: [0, 0, 1]}", "1: planes", "list"},
        Mistake{"planes: [{offset: 1}]", "1: planes[0].normal", "required"},
        Mistake{"planes: [{normal: [0, 0, 0]}]", "1: planes[0].normal", "length zero"},
        Mistake{"planes: [{normal: [0, 0, 1], offset: .inf}]", "1: planes[0].offset", "within"},
        Mistake{"box: {min: [0, 0, 0], max: [1, 1, 0]}\ngravity: [0, 0, -1]", "2: gravity",
                "planar"},
        Mistake{"box: {min: [0, 0, 0], max: [1, 1, 0]}\nplanes: [{normal: [0, 0, 1]}]",
                "2: planes[0].normal", "planar"}));

INSTANTIATE_TEST_SUITE_P(
    Balls, SceneMistake,
    testing::Values(
        Mistake{"balls: 3", "1: balls", "list"}, Mistake{"balls: [3]", "1: balls[0]", "a map"},
        Mistake{ball("radius: 1, mass: 1"), "2: balls[0].position", "required"},
        Mistake{ball("position: [0, 0, 0], mass: 1"), "2: balls[0].radius", "required"},
        Mistake{ball("position: [0, 0, 0], radius: 1"), "2: balls[0].mass", "required"},
        Mistake{ball("position: [0, .inf, 0], radius: 1, mass: 1"), "2: balls[0].position[1]",
                "within"},
        Mistake{ball("position: [0, 0, 0], radius: 0, mass: 1"), "2: balls[0].radius", "above 0"},
        Mistake{ball("position: [0, 0, 0], radius: .inf, mass: 1"), "2: balls[0].radius",
                "above 0"},
        Mistake{ball("position: [0, 0, 0], radius: 1e-300, mass: 1"), "2: balls[0].radius",
                "within"},
        Mistake{ball("position: [0, 0, 0], radius: 1, mass: 0"), "2: balls[0].mass", "above 0"},
        Mistake{ball("position: [0, 0, 0], radius: 1, mass: -.inf"), "2: balls[0].mass", "above 0"},
        Mistake{ball("position: [0, 0, 0], radius: 1, mass: .inf, velocity: [1, 0, 0]"),
                "2: balls[0].velocity", "fixed"},
        Mistake{ball("position: [0, 0, 0], radius: 1, mass: 1, velocity: [1, 0, 1e10]"),
                "2: balls[0].velocity[2]", "within"},
        Mistake{"box: {min: [0, 0, 0], max: [1, 1, 1]}\n" +
                    ball("position: [1, 0.5, 0.5], radius: 0.1, mass: 1"),
                "3: balls[0].position", "sticks out 0.1 m beyond the box's x-max face"},
        Mistake{"planes: [{normal: [0, 0, 1], offset: 1}]\n" +
                    ball("position: [0, 0, 1], radius: 0.5, mass: 1"),
                "3: balls[0].position", "beyond plane 0"},
        Mistake{"box: {min: [0, 0, 0], max: [1, 1, 0]}\n" +
                    ball("position: [0.5, 0.5, 0.1], radius: 0.1, mass: 1"),
                "3: balls[0].position", "planar"},
        Mistake{"box: {min: [0, 0, 0], max: [1, 1, 1]}\nperiodic: true\nballs:\n"
                "  - {position: [0.02, 0.5, 0.5], radius: 0.1, mass: 1}\n"
                "  - {position: [0.98, 0.5, 0.5], radius: 0.1, mass: 1}\n",
                "5: balls[1].position", "centres 0.04 m apart"}));

INSTANTIATE_TEST_SUITE_P(
    Fills, SceneMistake,
    testing::Values(
        Mistake{fill("radius: 0.1, mass: 1"), "3: fill[0].count", "required"},
        Mistake{fill("count: -1, radius: 0.1, mass: 1"), "3: fill[0].count", "whole number"},
        Mistake{fill("count: 1.5, radius: 0.1, mass: 1"), "3: fill[0].count", "whole number"},
        Mistake{fill("count: 0, radius: 0.1, mass: 1"), "3: fill[0].count", "whole number"},
        Mistake{fill("count: 100000000, radius: 0.1, mass: 1"), "3: fill[0].count", "within"},
        Mistake{fill("count: 1, radius: [0.2, 0.1], mass: 1"), "3: fill[0].radius", "[min, max]"},
        Mistake{fill("count: 1, radius: [0.2], mass: 1"), "3: fill[0].radius", "list of 2"},
        Mistake{fill("count: 1, radius: 0.1"), "3: fill[0].mass", "required"},
        Mistake{fill("count: 1, radius: 0.1, mass: 1, density: 1"), "3: fill[0].density", "both"},
        Mistake{fill("count: 1, radius: 0.1, mass: [1, .inf]"), "3: fill[0].mass[1]", "finite"},
        Mistake{fill("count: 1, radius: 0.1, mass: 1, seed: -1"), "3: fill[0].seed",
                "whole number"},
        Mistake{fill("count: 1, radius: 0.1, mass: 1, seed: 18446744073709551616"),
                "3: fill[0].seed", "whole number"},
        Mistake{fill("count: 1, radius: 0.1, mass: 1, speed_sigma: -1"), "3: fill[0].speed_sigma",
                "within"},
        Mistake{fill("count: 1, radius: 0.1, mass: 1, packing_fraction: 0.1"),
                "3: fill[0].packing_fraction", "open extents"},
        Mistake{"fill: [{count: 1, radius: 0.1, mass: 1, packing_fraction: 0.8}]",
                "1: fill[0].packing_fraction", "densest"},
        Mistake{"fill: [{count: 1, radius: 0.1, mass: 1}]", "1: fill[0]", "open faces"},
        Mistake{"fill:\n  - {count: 1, radius: 0.1, mass: 1, packing_fraction: 0.1}\n"
                "  - {count: 1, radius: 0.1, mass: 1, packing_fraction: 0.2}",
                "3: fill[1].packing_fraction", "one packing fraction"}));

INSTANTIATE_TEST_SUITE_P(Method, SceneMistake,
                         testing::Values(Mistake{"method: magic", "1: method", "event_driven"},
                                         Mistake{"time_step: 0", "1: time_step", "above 0"},
                                         Mistake{"time_step: .inf", "1: time_step", "above 0"},
                                         Mistake{"tolerance: -1", "1: tolerance", "above 0"},
                                         Mistake{"simultaneous_impacts: both",
                                                 "1: simultaneous_impacts",
                                                 "must be sequential or simultaneous"}));

TEST(SceneReader, NamesFilesItCannotRead) {
  try {
    readScene("/nowhere/scene.yaml");
    FAIL();
  } catch (const SceneError& error) {
    EXPECT_STREQ(error.what(), "/nowhere/scene.yaml: cannot be read: No such file or directory");
  }
  EXPECT_THROW(readScene(testing::TempDir()), SceneError);
}

TEST(SceneReader, SurvivesGarbage) {
  EXPECT_NE(refusalOf(std::string(100000, '[')), "accepted");
  EXPECT_NE(refusalOf(std::string("name: \0\x01\xff", 9)), "");
  EXPECT_NE(refusalOf("a: &a [*a]"), "accepted");
  EXPECT_NE(refusalOf("balls: &b [*b, *b]"), "accepted");
}

}  // namespace
}  // namespace ball_sim::core
