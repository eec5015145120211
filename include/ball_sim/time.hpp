// Simulated time as whole seconds and a fraction: as fine at 10^9 s as at the start.
#pragma once

#include <cassert>
#include <cmath>
#include <cstdint>

namespace ball_sim::core {

/// An instant of simulated time.
///
/// A plain double loses v ulp(t) of a ball's place, 1e-7 m at 10^9 s and 1 m/s; here the fraction
/// keeps its 2^-53 s at any date. Limits: +-2^62 s.
class Time {
 public:
  constexpr Time() = default;

  /// @param seconds s, finite, magnitude below 2^62
  static Time fromSeconds(double seconds) { return Time() + seconds; }

  /// @param nanoseconds ns, any sign
  static Time fromNanoseconds(std::int64_t nanoseconds) {
    constexpr std::int64_t kBillion = 1000000000;
    std::int64_t whole = nanoseconds / kBillion;
    std::int64_t rest = nanoseconds % kBillion;
    if (rest < 0) {
      rest += kBillion;
      --whole;
    }
    return Time(whole, static_cast<double>(rest) / 1e9);
  }

  /// Seconds since time 0, rounded to double.
  double seconds() const { return static_cast<double>(whole_) + fraction_; }

  /// Whole nanoseconds since time 0, rounded to nearest. Limits: +-292 years.
  std::int64_t nanoseconds() const {
    return whole_ * 1000000000 + static_cast<std::int64_t>(std::llround(fraction_ * 1e9));
  }

  /// @param seconds s, finite, magnitude below 2^62
  Time operator+(double seconds) const {
    assert(std::isfinite(seconds));
    const double floor = std::floor(seconds);
    return Time(whole_ + static_cast<std::int64_t>(floor), fraction_ + (seconds - floor));
  }

  /// Difference in seconds, rounded once.
  double operator-(const Time& other) const {
    return static_cast<double>(whole_ - other.whole_) + (fraction_ - other.fraction_);
  }

  bool operator==(const Time& o) const { return whole_ == o.whole_ && fraction_ == o.fraction_; }
  bool operator!=(const Time& o) const { return !(*this == o); }
  bool operator<(const Time& o) const {
    return whole_ < o.whole_ || (whole_ == o.whole_ && fraction_ < o.fraction_);
  }
  bool operator>(const Time& o) const { return o < *this; }
  bool operator<=(const Time& o) const { return !(o < *this); }
  bool operator>=(const Time& o) const { return !(*this < o); }

 private:
  Time(std::int64_t whole, double fraction) : whole_(whole), fraction_(fraction) {
    if (fraction_ >= 1) {
      fraction_ -= 1;
      ++whole_;
    }
  }

  std::int64_t whole_ = 0;  // s
  double fraction_ = 0;     // s, in [0, 1)
};

}  // namespace ball_sim::core
