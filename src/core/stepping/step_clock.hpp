// The clock of the stepping methods: steps of equal length on a grid that is fixed once it starts.
//
// Whether a step is due depends on the date alone, never on how one got there. Every 2^20 steps the
// count begins anew, so that dates stay fine however long the run is.
#pragma once

#include <cstdint>

#include "ball_sim/time.hpp"

namespace ball_sim::core {

class StepClock {
 public:
  /// @param length  of a step, s, > 0
  explicit StepClock(double length) : length_(length) {}

  double length() const { return length_; }  ///< s

  /// Begins a new grid at `date`.
  void start(Time date) {
    base_ = date;
    count_ = 0;
  }

  /// Date of the last step taken.
  Time last() const { return at(count_); }

  /// Whether the next step has to be taken to reach `date`. A date that rounding puts just before
  /// a step counts as that step's: three steps of 0.1 s are due at 0.3 s.
  bool isDue(Time date) const { return date - at(count_ + 1) >= -kDateSlack * length_; }

  void tick() {
    ++count_;
    if (count_ == kRestart) start(last());
  }

 private:
  static constexpr std::uint64_t kRestart = std::uint64_t{1} << 20;
  static constexpr double kDateSlack = 1e-9;  // of a step; 2^20 steps round by 1e-10 of one

  Time at(std::uint64_t count) const { return base_ + static_cast<double>(count) * length_; }

  double length_;  // s
  Time base_;
  std::uint64_t count_ = 0;  // steps since base_
};

}  // namespace ball_sim::core
