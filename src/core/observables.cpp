// Numbers that describe a state: energy, momentum, hash.
#include "ball_sim/observables.hpp"

#include <cassert>
#include <cmath>
#include <cstring>

namespace ball_sim::core {
namespace {

// Adds with a running correction for what rounding lost. Source: Neumaier, "Rundungsfehleranalyse
// einiger Verfahren zur Summation endlicher Summen", ZAMM 54 (1974).
class Sum {
 public:
  void add(double term) {
    const double total = total_ + term;
    lost_ += std::abs(total_) >= std::abs(term) ? (total_ - total) + term : (term - total) + total_;
    total_ = total;
  }
  double value() const { return total_ + lost_; }

 private:
  double total_ = 0;
  double lost_ = 0;
};

// FNV-1a, 64 bits. Source: Fowler, Noll, Vo, draft-eastlake-fnv.
class Fnv1a {
 public:
  // Eight bytes from the lowest up, whatever the machine's byte order.
  void add(std::uint64_t bits) {
    for (int byte = 0; byte < 8; ++byte) {
      hash_ ^= (bits >> (8 * byte)) & 0xff;
      hash_ *= 0x100000001b3;
    }
  }
  void add(const Vector3& vector) {
    for (int axis = 0; axis < 3; ++axis) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, &vector[axis], sizeof bits);
      add(bits);
    }
  }
  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325;
};

}  // namespace

double kineticEnergy(const BallStates& states, const std::vector<double>& masses) {
  assert(states.velocities.size() == masses.size());
  Sum sum;
  for (std::size_t i = 0; i < masses.size(); ++i) {
    const Vector3& v = states.velocities[i];
    if (std::isfinite(masses[i])) sum.add(0.5 * masses[i] * dot(v, v));
  }
  return sum.value();
}

double potentialEnergy(const BallStates& states, const std::vector<double>& masses,
                       const Vector3& gravity) {
  assert(states.positions.size() == masses.size());
  Sum sum;
  for (std::size_t i = 0; i < masses.size(); ++i) {
    if (std::isfinite(masses[i])) sum.add(-masses[i] * dot(gravity, states.positions[i]));
  }
  return sum.value();
}

Vector3 momentum(const BallStates& states, const std::vector<double>& masses) {
  assert(states.velocities.size() == masses.size());
  Sum sums[3];
  for (std::size_t i = 0; i < masses.size(); ++i) {
    if (!std::isfinite(masses[i])) continue;
    for (int axis = 0; axis < 3; ++axis) sums[axis].add(masses[i] * states.velocities[i][axis]);
  }
  return {sums[0].value(), sums[1].value(), sums[2].value()};
}

std::uint64_t stateHash(const BallStates& states) {
  Fnv1a hash;
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    hash.add(states.ids[i]);
    hash.add(states.positions[i]);
    hash.add(states.velocities[i]);
  }
  return hash.value();
}

}  // namespace ball_sim::core
