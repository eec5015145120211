// Places equal balls on a crystal with random vacancies.
#include "packing_lattice.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "ball_sim/ball_check.hpp"
#include "packing_room.hpp"

namespace ball_sim::core {
namespace {

// How close-packed layers are built and piled up; lengths in units of the spacing of neighbours.
struct Stacking {
  double site;   // from site to site in a row
  double rows;   // across two rows, after which they repeat; the second is shifted by half a site
  double layer;  // from layer to layer
  double shift;  // of every other layer across its rows, as a share of two rows
};

// Both have the density 0.7405 in space; they differ in the boxes they fit. In the plane the first
// has 0.9069. Source: Conway, Sloane, Sphere Packings, Lattices and Groups, 1.
const Stacking kHexagonal = {1, std::sqrt(3.0), std::sqrt(2.0 / 3.0), 1.0 / 3.0};
const Stacking kFaceCentredCubic = {std::sqrt(2.0), std::sqrt(2.0), std::sqrt(0.5), 1.0 / 2.0};

// More balls than we place: stops a search in a very wide box.
constexpr double kMostSites = 1e8;

// The directions of rows (a), across rows (b) and across layers (c).
using Orientation = std::array<int, 3>;

struct Lattice {
  Stacking stacking = kHexagonal;
  Orientation axes = {0, 1, 2};
  double spacing = 0;  // d, m
};

// The extent along each axis that centres have, m.
Vector3 extentOf(const Surroundings& surroundings, double radius) {
  const Box room = centresWithin(surroundings, radius);
  Vector3 extent = room.max - room.min;
  if (surroundings.planar()) extent.z() = 0;
  return extent;
}

// How many steps of `step` from `offset` on stay within `extent`; around a periodic extent whole
// steps alone.
std::size_t countAlong(double extent, double step, double offset, bool periodic) {
  if (periodic) return static_cast<std::size_t>(std::min(extent / step, kMostSites));
  if (extent < offset) return 0;
  return static_cast<std::size_t>(std::min((extent - offset) / step, kMostSites)) + 1;
}

// How far layer k is shifted across its rows, as a share of two rows: A, B, A, B, ...; around an
// odd periodic stack the last one is C, for A and A would lie on each other.
double layerShift(const Stacking& stacking, std::size_t k, std::size_t layers, bool periodic) {
  if (periodic && layers % 2 == 1 && k + 1 == layers) return 2 * stacking.shift;
  return k % 2 == 0 ? 0 : stacking.shift;
}

// The number of layers; 0: such a pile does not fit.
std::size_t countLayers(const Lattice& lattice, double extent, const Surroundings& surroundings) {
  if (surroundings.planar()) return 1;
  const std::size_t layers =
      countAlong(extent, lattice.stacking.layer * lattice.spacing, 0, surroundings.periodic);
  if (!surroundings.periodic) return layers;
  if (lattice.stacking.shift == 0.5) return layers - layers % 2;  // it has no C
  return layers < 2 ? 0 : layers;
}

// Calls visit(count, a, b, c) for each row of sites: their number, and where the row begins, in m
// from the corner of the room along the lattice's axes; until it returns false.
template <class Visit>
void forEachRow(const Lattice& lattice, const Vector3& extent, const Surroundings& surroundings,
                Visit visit) {
  const bool periodic = surroundings.periodic;
  const double site = lattice.stacking.site * lattice.spacing;
  const double pair = lattice.stacking.rows * lattice.spacing;
  const double layer = lattice.stacking.layer * lattice.spacing;
  const std::size_t layers = countLayers(lattice, extent[lattice.axes[2]], surroundings);
  for (std::size_t k = 0; k < layers; ++k) {
    for (int half = 0; half < 2; ++half) {
      const double a = half * site / 2;
      double b = pair * layerShift(lattice.stacking, k, layers, periodic) + half * pair / 2;
      if (b >= pair) b -= pair;
      const std::size_t sites = countAlong(extent[lattice.axes[0]], site, a, periodic);
      const std::size_t rows = countAlong(extent[lattice.axes[1]], pair, b, periodic);
      if (periodic && sites < 2) return;
      for (std::size_t j = 0; j < rows; ++j) {
        const double along_b = b + static_cast<double>(j) * pair;
        if (!visit(sites, a, along_b, static_cast<double>(k) * layer)) return;
      }
    }
  }
}

double countSites(const Lattice& lattice, const Vector3& extent, const Surroundings& surroundings) {
  double count = 0;
  forEachRow(lattice, extent, surroundings, [&count](std::size_t sites, double, double, double) {
    count += static_cast<double>(sites);
    return count < kMostSites;
  });
  return count;
}

// The widest spacing from `least` up with `needed` sites; 0 when even `least` has fewer.
double widestSpacing(const Stacking& stacking, const Orientation& axes, double least, double needed,
                     const Vector3& extent, const Surroundings& surroundings) {
  const auto enough = [&](double d) {
    return countSites({stacking, axes, d}, extent, surroundings) >= needed;
  };
  if (!enough(least)) return 0;
  double lower = least;
  double upper = 2 * (least + extent.maxCoeff());
  for (int step = 0; step < 50; ++step) {  // a spacing is not needed to the last bit
    const double middle = (lower + upper) / 2;
    (enough(middle) ? lower : upper) = middle;
  }
  return lower;
}

Lattice widestLattice(double least, double needed, const Vector3& extent,
                      const Surroundings& surroundings) {
  Lattice widest;
  Orientation axes = {0, 1, 2};
  do {
    if (surroundings.planar() && axes[2] != 2) continue;
    for (const Stacking& stacking : {kHexagonal, kFaceCentredCubic}) {
      const double d = widestSpacing(stacking, axes, least, needed, extent, surroundings);
      if (d > widest.spacing) widest = {stacking, axes, d};
    }
  } while (std::next_permutation(axes.begin(), axes.end()));
  return widest;
}

// The sites, each axis stretched until they fill the room: no two come nearer by that.
std::vector<Vector3> sitesOf(const Lattice& lattice, const Vector3& extent, const Box& room,
                             const Surroundings& surroundings) {
  std::vector<Vector3> sites;
  const double steps[3] = {lattice.stacking.site * lattice.spacing,
                           lattice.stacking.rows * lattice.spacing,
                           lattice.stacking.layer * lattice.spacing};
  forEachRow(lattice, extent, surroundings, [&](std::size_t count, double a, double b, double c) {
    for (std::size_t i = 0; i < count; ++i) {
      Vector3 site = Vector3::Zero();
      site[lattice.axes[0]] = a + static_cast<double>(i) * steps[0];
      site[lattice.axes[1]] = b;
      site[lattice.axes[2]] = c;
      sites.push_back(site);
    }
    return true;
  });
  Vector3 stretch = Vector3::Ones();
  for (std::size_t i = 0; i < 3; ++i) {
    const int axis = lattice.axes[i];
    if (axis == 2 && surroundings.planar()) continue;
    double used = 0;
    if (surroundings.periodic) {
      const std::size_t count = i == 2 ? countLayers(lattice, extent[axis], surroundings)
                                       : countAlong(extent[axis], steps[i], 0, true);
      used = static_cast<double>(count) * steps[i];
    } else {
      for (const Vector3& site : sites) used = std::max(used, site[axis]);
    }
    if (used > 0) stretch[axis] = extent[axis] / used;
  }
  for (Vector3& site : sites) site = room.min + site.cwiseProduct(stretch);
  return sites;
}

// A random shift of at most `most` m, within the plane of a planar scene.
Vector3 randomShift(double most, bool planar, RandomSource& random) {
  while (true) {
    Vector3 shift = Vector3::Zero();
    for (int axis = 0; axis < (planar ? 2 : 3); ++axis) shift[axis] = random.uniform(-1, 1);
    if (dot(shift, shift) <= 1) return most * shift;
  }
}

}  // namespace

bool placeOnLattice(std::vector<Ball>& balls, const Surroundings& surroundings,
                    const std::vector<Ball>& present, RandomSource& random) {
  const double radius = balls.front().radius;
  const Vector3 extent = extentOf(surroundings, radius);
  if (extent.minCoeff() < 0) return false;
  const Box room = centresWithin(surroundings, radius);
  const OverlapIndex others = indexOf(present, surroundings);
  const auto is_free = [&](const Vector3& place) {
    return !checkPlace(place, radius, surroundings) && !others.overlapsAny(place, radius);
  };
  // Sites that planes or other balls take are made up for by a narrower lattice.
  double needed = static_cast<double>(balls.size());
  for (int attempt = 0; attempt < 8; ++attempt) {
    const double least = 2 * radius * (1 + 1e-9);  // rounding of places must not make overlaps
    const Lattice lattice = widestLattice(least, needed, extent, surroundings);
    if (lattice.spacing == 0) return false;
    std::vector<Vector3> sites = sitesOf(lattice, extent, room, surroundings);
    const auto taken = std::remove_if(sites.begin(), sites.end(),
                                      [&](const Vector3& site) { return !is_free(site); });
    const auto lost = static_cast<double>(sites.end() - taken);
    sites.erase(taken, sites.end());
    if (sites.size() < balls.size()) {
      needed += std::max(1.0, lost);
      continue;
    }
    const double gap = (lattice.spacing - 2 * radius) / 2 * (1 - 1e-6);
    for (std::size_t i = 0; i < balls.size(); ++i) {
      std::swap(sites[i], sites[i + random.below(sites.size() - i)]);
      const Vector3 shifted = (sites[i] + randomShift(gap, surroundings.planar(), random))
                                  .cwiseMax(room.min)
                                  .cwiseMin(room.max);
      balls[i].position = is_free(shifted) ? shifted : sites[i];
    }
    return true;
  }
  return false;
}

}  // namespace ball_sim::core
