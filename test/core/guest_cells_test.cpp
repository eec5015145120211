// The cells of guests: which of them are within reach of a home, and what crossings change in that,
// against a look at every cell and every image.
#include "event_driven/guest_cells.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "event_driven/grid_layout.hpp"
#include "support/random_numbers.hpp"
#include "support/random_scenes.hpp"

namespace ball_sim::core {
namespace test {
namespace {

using Axes = std::array<GuestCells::Axis, 3>;

/// Every cell has one guest, whose slot tells which cell it is.
struct GuestGrid {
  GuestGrid(const Axes& cut, double within) : axes(cut), reach(within), cells(cut, within, 2) {
    cells.resize(static_cast<std::size_t>(cut[0].cells * cut[1].cells * cut[2].cells));
    forEachCell([&](const CellCoordinates& c) { cells.link(slotOf(c), cells.cellIndex(c)); });
  }

  template <class Function>
  void forEachCell(Function f) const {
    CellCoordinates c{};
    for (c[2] = 0; c[2] < axes[2].cells; ++c[2]) {
      for (c[1] = 0; c[1] < axes[1].cells; ++c[1]) {
        for (c[0] = 0; c[0] < axes[0].cells; ++c[0]) f(c);
      }
    }
  }

  Slot slotOf(const CellCoordinates& c) const {
    return static_cast<Slot>((c[2] * axes[1].cells + c[1]) * axes[0].cells + c[0]);
  }

  /// The guests in cells of which any image comes as near to the home as `reach`.
  std::set<Slot> inReach(const CellCoordinates& home) const {
    std::set<Slot> found;
    forEachCell([&](const CellCoordinates& c) {
      double squares = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        double least = INFINITY;
        const bool wraps = axes[k].periodic || axes[k].open;
        for (int image = wraps ? -3 : 0; image <= (wraps ? 3 : 0); ++image) {
          const int apart = std::abs(c[k] + image * axes[k].cells - home[k]);
          least = std::min(least, std::max(0, apart - 1) * axes[k].edge);
        }
        squares += least * least;
      }
      if (squares <= reach * reach) found.insert(slotOf(c));
    });
    return found;
  }

  /// The next home; false: behind a wall.
  bool step(CellCoordinates& home, std::size_t axis, int direction) const {
    home[axis] += direction;
    const GuestCells::Axis& along = axes[axis];
    if (along.periodic) home[axis] = (home[axis] + along.cells) % along.cells;
    return along.open || (home[axis] >= 0 && home[axis] < along.cells);
  }

  Axes axes;
  double reach;
  GuestCells cells;
};

template <class Gather>
std::vector<Slot> found(Gather gather) {
  Candidates candidates;
  gather(candidates);
  std::vector<Slot> slots(candidates.slots.begin(),
                          candidates.slots.begin() + static_cast<std::ptrdiff_t>(candidates.count));
  std::sort(slots.begin(), slots.end());
  return slots;
}

std::vector<Slot> sorted(const std::set<Slot>& slots) { return {slots.begin(), slots.end()}; }

/// From walls to none, from one cell to more than are within reach; edges that differ.
std::vector<Axes> cuts() {
  const auto closed = [](int n, double edge) { return GuestCells::Axis{n, false, false, edge}; };
  const auto periodic = [](int n, double edge) { return GuestCells::Axis{n, true, false, edge}; };
  const auto open = [](int n, double edge) { return GuestCells::Axis{n, false, true, edge}; };
  return {
      {closed(9, 0.25), closed(8, 0.25), closed(10, 0.3)},
      {periodic(8, 0.25), periodic(12, 0.27), periodic(9, 0.25)},
      {open(8, 0.25), open(16, 0.25), closed(4, 0.25)},
      {periodic(4, 0.25), periodic(5, 0.25), periodic(6, 0.25)},
      {open(1, 0.25), open(2, 0.25), open(4, 0.25)},
      {closed(1, 0.25), closed(2, 0.25), periodic(3, 0.25)},
      {periodic(1, 0.25), periodic(2, 0.25), closed(1, 1)},
  };
}

TEST(GuestCells, AHomeReachesTheCellsThatComeNearEnough) {
  for (const Axes& axes : cuts()) {
    for (const double reach : {0.0, 0.3, 0.5, 0.63}) {
      const GuestGrid grid(axes, reach);
      grid.forEachCell([&](const CellCoordinates& home) {
        const auto near = found([&](Candidates& c) { grid.cells.gather(home, c); });
        ASSERT_EQ(near, sorted(grid.inReach(home))) << "each once, at reach " << reach;
      });
    }
  }
}

TEST(GuestCells, OnOpenAxesCellsAreFoundFromEverywhere) {
  const GuestGrid grid(cuts()[2], 0.5);
  for (const int x : {-17, -8, -1, 8, 100}) {
    const CellCoordinates here = {x, 5 - 16, 1};
    const CellCoordinates within = {((x % 8) + 8) % 8, 5, 1};
    EXPECT_EQ(found([&](Candidates& c) { grid.cells.gather(here, c); }),
              sorted(grid.inReach(within)));
  }
}

TEST(GuestCells, ACrossingShowsJustTheCellsThatWereOutOfReachBefore) {
  for (const Axes& axes : cuts()) {
    const GuestGrid grid(axes, 0.5);
    grid.forEachCell([&](const CellCoordinates& before) {
      const std::set<Slot> known = grid.inReach(before);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        for (const int direction : {-1, 1}) {
          CellCoordinates home = before;
          if (!grid.step(home, axis, direction)) continue;
          CellCoordinates within = home;
          if (axes[axis].open) within[axis] &= axes[axis].cells - 1;
          std::set<Slot> fresh;
          for (const Slot slot : grid.inReach(within)) {
            if (known.count(slot) == 0) fresh.insert(slot);
          }
          ASSERT_EQ(found([&](Candidates& c) { grid.cells.gatherNew(home, axis, direction, c); }),
                    sorted(fresh));
        }
      }
    });
  }
}

/// What the cells tell of their hosts against what the homes tell.
void expectHosts(const GuestGrid& grid, const std::map<Slot, CellCoordinates>& homes) {
  grid.forEachCell([&](const CellCoordinates& c) {
    std::vector<Slot> near;
    for (const auto& [host, home] : homes) {
      if (grid.inReach(home).count(grid.slotOf(c)) > 0) near.push_back(host);
    }
    const Hosts hosts = grid.cells.hostsAt(grid.cells.cellIndex(c));
    ASSERT_EQ(hosts.none(), near.empty());
    ASSERT_EQ(hosts.isSingle(), near.size() == 1);
    if (near.size() == 1) {
      ASSERT_EQ(hosts.single(), near[0]);
    }
  });
}

TEST(GuestCells, CellsKnowWhoseReachTheyAreInWhereverHostsGo) {
  for (const Axes& axes : cuts()) {
    GuestGrid grid(axes, 0.5);
    RandomNumbers random(1);
    std::map<Slot, CellCoordinates> homes;
    for (Slot host = 1000; host < 1004; ++host) {
      CellCoordinates home{};
      for (std::size_t k = 0; k < 3; ++k) {
        home[k] = static_cast<std::int32_t>(random.index(static_cast<std::size_t>(axes[k].cells)));
      }
      grid.cells.addHost(host, home);
      homes[host] = home;
    }
    expectHosts(grid, homes);
    for (int steps = 0; steps < 100; ++steps) {
      const auto host = static_cast<Slot>(1000 + random.index(4));
      const std::size_t axis = random.index(3);
      const int direction = random.chance(0.5) ? 1 : -1;
      const CellCoordinates from = homes[host];
      CellCoordinates to = from;
      // Within what inReach() knows of open axes.
      if (!grid.step(to, axis, direction) || to[axis] < 0 || to[axis] >= axes[axis].cells) continue;
      grid.cells.moveHost(host, from, to, axis, direction);
      homes[host] = to;
    }
    expectHosts(grid, homes);
    while (!homes.empty()) {
      grid.cells.removeHost(homes.begin()->first, homes.begin()->second);
      homes.erase(homes.begin());
      expectHosts(grid, homes);
    }
  }
}

TEST(GuestCells, ACrowdOfHostsIsNeverForgotten) {
  Hosts hosts;
  for (Slot slot = 0; slot < 100; ++slot) hosts.add(slot);
  for (Slot slot = 0; slot < 99; ++slot) {
    hosts.remove(slot);
    EXPECT_FALSE(hosts.none());
    EXPECT_FALSE(hosts.isSingle()) << "more than can be counted have been there";
  }
}

/// How often the cells of the coarsest level are halved for the guests.
double halvingsOf(const TestScene& scene) {
  std::vector<GridBall<double>> balls;
  for (const Ball& ball : scene.balls) balls.push_back({ball.position, ball.radius});
  const CellGrid<double> grid = layOutGrid<double>(scene.surroundings, balls, 0);
  return std::log2(grid.edge(0, 0) / grid.latticeOf(0).spacing[0]);
}

TEST(GuestCells, AreHalvedWhereGuestsAreMany) {
  const auto halvings = [](const std::string& name) {
    const std::vector<SceneKind> kinds = sceneKinds();
    const auto kind = std::find_if(kinds.begin(), kinds.end(),
                                   [&](const SceneKind& k) { return k.name == name; });
    const TestScene scene = randomScene(*kind, 1);
    EXPECT_EQ(scene.balls.size(), kind->count) << name;
    return halvingsOf(scene);
  };
  EXPECT_EQ(halvings("closed_3d"), 0) << "one level";
  EXPECT_EQ(halvings("half_open_3d_gravity"), 0) << "few guests";
  EXPECT_EQ(halvings("several_large_once_halved"), 1);
  EXPECT_EQ(halvings("several_large_3d"), 2);
  EXPECT_EQ(halvings("several_large_2d"), 3);
  EXPECT_EQ(halvings("several_large_three_levels"), 2);
  EXPECT_EQ(halvings("several_large_open_2d"), 2);
  EXPECT_EQ(halvings("several_large_half_open"), 1);
  EXPECT_EQ(halvings("several_large_gravity"), 3);
  EXPECT_EQ(halvings("several_large_apart"), 2);
  EXPECT_EQ(halvings("several_large_ratio_10"), 2);
  EXPECT_EQ(halvings("several_large_periodic_2d"), 2);
  EXPECT_EQ(halvings("several_large_periodic_3d"), 1);
}

/// A host and one of the largest guests touch, wherever they do: each is found from the other.
TEST(GuestCells, WhoTouchesIsFound) {
  const double host_radius = 0.11;
  const double guest_radius = 0.02;
  for (const bool periodic : {false, true}) {
    Surroundings around;
    around.box = {Vector3::Zero(), Vector3(1, 0.9, 0)};
    around.periodic = periodic;
    RandomNumbers random(1);
    std::vector<GridBall<double>> balls(300, {Vector3(0.5, 0.5, 0), guest_radius});
    balls.push_back({Vector3(0.5, 0.5, 0), host_radius});
    CellGrid<double> grid = layOutGrid<double>(around, balls, 0);
    ASSERT_EQ(grid.homeDepth(0), 2);
    ASSERT_EQ(grid.finestLevel(), 1u);
    grid.resize(2);
    for (int trial = 0; trial < 20000; ++trial) {
      const Vector3 place(random.uniform(0, 1), random.uniform(0, 0.9), 0);
      Vector3 way = random.gaussianVector(1);
      way.z() = 0;
      Vector3 other = place + (host_radius + guest_radius) / way.norm() * way;
      for (int axis = 0; axis < 2; ++axis) {
        const double edge = around.box.max[axis];
        if (periodic) other[axis] -= edge * std::floor(other[axis] / edge);
      }
      const bool inside = other.x() >= 0 && other.x() < 1 && other.y() >= 0 && other.y() < 0.9;
      if (!inside) continue;
      const CellCoordinates host = grid.coordinatesOf(place, grid.homeDepth(0));
      const CellCoordinates guest = grid.coordinatesOf(other, grid.homeDepth(1));
      grid.link(0, host, 0);
      grid.link(1, guest, 1);
      const std::vector<Slot> both = {0, 1};
      ASSERT_EQ(found([&](Candidates& c) { grid.gatherNear(host, 0, c); }), both);
      ASSERT_EQ(found([&](Candidates& c) { grid.gatherNear(guest, 1, c); }), both);
      grid.unlink(0, host, 0);
      grid.unlink(1, guest, 1);
    }
  }
}

/// In a box of 1 m, far more specks at rest in a corner than it takes to halve cells; the balls
/// that matter are kept by nobody else from flying on.
TestScene besideSpecks(const std::vector<Ball>& balls) {
  TestScene scene;
  scene.surroundings.box = {Vector3::Zero(), Vector3(1, 1, 0)};
  scene.balls = balls;
  for (int i = 0; i < 1000; ++i) {
    const Vector3 place(0.002 * (i % 32 + 1), 0.002 * (i / 32 + 1), 0);
    scene.balls.push_back({place, Vector3::Zero(), 1e-5, 1});
  }
  return scene;
}

/// Runs a scene to its first impact of balls. @return when, s
double firstMeeting(const TestScene& scene) {
  EXPECT_GT(halvingsOf(scene), 0);
  Trial run("event_driven", scene);
  run.advanceTo(0.75);
  for (const Collision& impact : run.collisions()) {
    if (impact.b >= 0) return impact.time.seconds();
  }
  return INFINITY;
}

// Who is searched for but by a crossing: nothing else happens before. Times are right to rounding.
TEST(GuestCells, WhoComesFromAfarIsMet) {
  const double large = 0.05;
  const double speck = 1e-5;
  for (const int axis : {0, 1}) {
    const Vector3 along = Vector3::Unit(axis);
    const Vector3 across(0.5 - 0.5 * along.x(), 0.5 - 0.5 * along.y(), 0);
    for (const int sign : {-1, 1}) {
      const Vector3 here = across + (0.5 - 0.35 * sign) * along;
      const Vector3 there = across + (0.5 + 0.35 * sign) * along;
      const Vector3 thither = sign * along;
      const auto meeting = [&](double r1, const Vector3& v1, double r2, const Vector3& v2) {
        return firstMeeting(besideSpecks({{here, v1, r1, 1}, {there, v2, r2, 1}}));
      };
      const Vector3 rest = Vector3::Zero();
      EXPECT_NEAR(meeting(large, thither, large, -thither), 0.3, 1e-14) << "two large balls";
      EXPECT_NEAR(meeting(large, thither, large, rest), 0.6, 1e-14) << "of which one rests";
      EXPECT_NEAR(meeting(large, thither, speck, rest), 0.65 - 1e-5, 1e-14) << "a guest at rest";
      EXPECT_NEAR(meeting(speck, thither, large, rest), 0.65 - 1e-5, 1e-14) << "a host at rest";
    }
  }
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
