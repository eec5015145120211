// Motions known in closed form: oracles that share no code with the simulator. In long double, so
// that what a comparison shows is the simulator's rounding and not theirs.
#pragma once

#include <cmath>
#include <utility>

namespace ball_sim::core {
namespace test {

using LongDouble = long double;
constexpr LongDouble kPi = 3.14159265358979323846264338327950288L;

/// A point that runs between two walls for ever, one axis: its place is a triangle wave, the
/// straight line x + v t folded with period 2 (upper - lower).
class FoldedLine {
 public:
  /// @param lower, upper  where the point turns, m (for a ball's centre: wall -+ radius)
  /// @param x, v  place, m, and velocity, m/s, at t = 0
  FoldedLine(LongDouble lower, LongDouble upper, LongDouble x, LongDouble v)
      : lower_(lower), width_(upper - lower), x_(x), v_(v) {}

  LongDouble positionAt(LongDouble t) const {
    const LongDouble phase = phaseAt(t);
    return lower_ + (phase < width_ ? phase : 2 * width_ - phase);
  }

  LongDouble velocityAt(LongDouble t) const { return phaseAt(t) < width_ ? v_ : -v_; }

 private:
  LongDouble phaseAt(LongDouble t) const {  // in [0, 2 width)
    const LongDouble unfolded = x_ - lower_ + v_ * t;
    return unfolded - 2 * width_ * std::floor(unfolded / (2 * width_));
  }

  LongDouble lower_, width_, x_, v_;
};

/// Two equal balls on a line between two walls, e = 1. Equal balls swap velocities, so with the
/// diameter cut out of the line they pass through each other: the places are the sorted folds.
class TwoBallsOnALine {
 public:
  /// @param lower, upper  the walls, m
  /// @param x1, x2  centres, m, x2 - x1 >= 2 radius
  TwoBallsOnALine(LongDouble lower, LongDouble upper, LongDouble radius, LongDouble x1,
                  LongDouble v1, LongDouble x2, LongDouble v2)
      : diameter_(2 * radius),
        first_(lower + radius, upper - 3 * radius, x1, v1),
        second_(lower + radius, upper - 3 * radius, x2 - 2 * radius, v2) {}

  /// @return centres of the left and of the right ball, m
  std::pair<LongDouble, LongDouble> positionsAt(LongDouble t) const {
    LongDouble left = first_.positionAt(t);
    LongDouble right = second_.positionAt(t);
    if (left > right) std::swap(left, right);
    return {left, right + diameter_};
  }

 private:
  LongDouble diameter_;
  FoldedLine first_, second_;
};

/// A ball dropped from rest on a floor, restitution e: bounce n comes at t1 (1 + 2 (e + ... +
/// e^n)), a geometric series.
class BouncingBall {
 public:
  /// @param height  of the ball's lowest point above the floor, m
  /// @param g  m/s^2
  BouncingBall(LongDouble height, LongDouble g, LongDouble restitution)
      : h_(height), g_(g), e_(restitution), t1_(std::sqrt(2 * height / g)) {}

  /// Date of the first impact, s.
  LongDouble firstImpact() const { return t1_; }

  /// Date from which on it lies still, s; e < 1.
  LongDouble restTime() const { return t1_ * (1 + e_) / (1 - e_); }

  /// Way travelled until it lies still, m; e < 1.
  LongDouble path() const { return h_ * (1 + e_ * e_) / (1 - e_ * e_); }

  /// Height of the lowest point at time t, m; e = 1 or t below the date of rest.
  LongDouble heightAt(LongDouble t) const {
    if (t < t1_) return h_ - g_ * t * t / 2;
    LongDouble since = t - t1_;
    LongDouble speed = e_ * g_ * t1_;
    if (e_ == 1) {
      since = std::fmod(since, 2 * t1_);
    } else {
      while (speed > 0 && since >= 2 * speed / g_) {
        since -= 2 * speed / g_;
        speed *= e_;
      }
    }
    return since * (speed - g_ * since / 2);
  }

 private:
  LongDouble h_, g_, e_, t1_;
};

/// Galperin's billiard: wall at 0, light ball (mass 1, at rest), heavy ball (mass 100^k, speed 1
/// towards the wall). Source: G. Galperin, "Playing pool with pi", 2003.
///
/// With the diameters cut out of the line, light at x and heavy at X >= x, the point
/// (10^k X, x) moves in a wedge of angle theta = atan(10^-k) and is reflected from its sides;
/// unfolded it is a straight line.
class GalperinBilliard {
 public:
  /// @param k  0, 1, 2, ...
  /// @param light, heavy  distances at t = 0, m, diameters cut out: 0 < light < heavy
  GalperinBilliard(int k, LongDouble light, LongDouble heavy)
      : root_(std::pow(10.0L, k)), theta_(std::atan(1 / root_)), light_(light), heavy_(heavy) {}

  /// Number of impacts in all: the first digits of pi.
  long count() const { return std::lround(std::ceil(kPi / theta_)) - 1; }

  /// Velocity of the heavy ball in the end, away from the wall, m/s.
  LongDouble heavySpeed() const { return -std::cos(evenCount() * theta_); }

  /// Velocity of the light ball in the end, away from the wall, m/s.
  LongDouble lightSpeed() const {
    return (count() % 2 == 0 ? 1 : -1) * root_ * std::sin(evenCount() * theta_);
  }

  /// Distances of light and heavy ball at time t, m, diameters cut out.
  std::pair<LongDouble, LongDouble> positionsAt(LongDouble t) const {
    const LongDouble along = root_ * (heavy_ - t);
    const LongDouble angle = std::atan2(light_, along);
    const LongDouble length = std::hypot(along, light_);
    const LongDouble phase = angle - 2 * theta_ * std::floor(angle / (2 * theta_));
    const LongDouble folded = phase < theta_ ? phase : 2 * theta_ - phase;
    return {length * std::sin(folded), length * std::cos(folded) / root_};
  }

 private:
  LongDouble evenCount() const { return static_cast<LongDouble>(count() + count() % 2); }

  LongDouble root_, theta_, light_, heavy_;
};

}  // namespace test
}  // namespace ball_sim::core
