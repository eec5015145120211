// Space that may wrap: nearest images, and the way home into the box.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "ball_sim/surroundings.hpp"
#include "ball_sim/vector.hpp"
#include "event_driven/pair_search.hpp"

namespace ball_sim::core {

template <class Real>
class PeriodicSpace {
  using Vec = VectorOf<Real>;

 public:
  explicit PeriodicSpace(const Surroundings& surroundings)
      : low_(surroundings.box.min.cast<Real>()), high_(surroundings.box.max.cast<Real>()) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!surroundings.periodic || (axis == 2 && surroundings.planar())) continue;
      pairs_.period[axis] = high_[axis] - low_[axis];
      pairs_.per_period[axis] = 1 / pairs_.period[axis];
    }
    pairs_.fall = surroundings.gravity.cast<Real>();
  }

  /// m; 0: that axis does not wrap.
  const Vec& period() const { return pairs_.period; }

  /// The same, as PairSearch takes it.
  const PairSpace<Real>& pairs() const { return pairs_; }

  /// Tells whether the nearest image of a ball is the only one in reach. In small boxes all that
  /// may be are looked at.
  void setNearestSuffices(bool suffices) {
    images_.clear();
    for (int image = 0; image < 27 && !suffices; ++image) {
      const Vec turns(Real(image % 3 - 1), Real(image / 3 % 3 - 1), Real(image / 9 - 1));
      const Vec shift = turns.cwiseProduct(period());
      if (std::find(images_.begin(), images_.end(), shift) == images_.end()) {
        images_.push_back(shift);
      }
    }
  }
  bool nearestSuffices() const { return images_.empty(); }

  /// Calls f with the shifts, m, of the images that are in reach beside the nearest, and with 0.
  template <class Function>
  void forEachImage(Function f) const {
    if (nearestSuffices()) return f(Vec(Vec::Zero()));
    for (const Vec& image : images_) f(image);
  }

  Vec nearestImage(Vec dx) const {
    for (int axis = 0; axis < 3; ++axis) {
      dx[axis] -= nearestWhole(dx[axis] * pairs_.per_period[axis]) * period()[axis];
    }
    return dx;
  }

  /// From a to the image of b that it meets: the nearest, but where several are in reach, the one
  /// it approaches fastest.
  Vec contactVector(const Body<Real>& a, const Body<Real>& b, Real reach) const {
    const Vec nearest = nearestImage(b.x - a.x);
    Vec best = nearest;
    Real fastest = -kNever<Real>;
    for (const Vec& shift : images_) {
      const Vec dx = nearest + shift;
      const Real approach = -dot(dx, Vec(b.v - a.v));
      if (dot(dx, dx) < reach * reach * Real(1 + 1e-9) && approach > fastest) {
        fastest = approach;
        best = dx;
      }
    }
    return best;
  }

  /// A crossing puts a ball back into the periodic box a rounding error early or late: x without
  /// it.
  Vec wrapped(Vec x) const {
    for (int axis = 0; axis < 3; ++axis) {
      if (!(period()[axis] > 0)) continue;
      if (x[axis] < low_[axis]) x[axis] += period()[axis];
      if (x[axis] >= high_[axis]) x[axis] -= period()[axis];
    }
    return x;
  }

  /// By how much to go back, in whole periods, to be in the box.
  Vec wayHome(const Vec& x) const {
    using std::floor;
    Vec way = Vec::Zero();
    for (int axis = 0; axis < 3; ++axis) {
      if (!(period()[axis] > 0)) continue;
      way[axis] = floor((x[axis] - low_[axis]) / period()[axis]) * period()[axis];
    }
    return way;
  }

 private:
  Vec low_, high_;  // the box, m
  PairSpace<Real> pairs_;
  std::vector<Vec> images_;  // m, shifts of a ball to be looked at: none but in small boxes
};

}  // namespace ball_sim::core
