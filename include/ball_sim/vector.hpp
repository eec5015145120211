// Vectors of the core.
//
// Eigen holds them; the few reductions that decide a trajectory are written out here, so that the
// order of the additions, and with it every bit, is the same whatever Eigen version or instruction
// set a build uses.
#pragma once

#include <Eigen/Core>

namespace ball_sim::core {

/// 3-vector over any floating-point type; storage without alignment demands, so it fits anywhere.
template <class Real>
using VectorOf = Eigen::Matrix<Real, 3, 1>;

/// 3-vector of doubles, the type of the public interface. SI units.
using Vector3 = VectorOf<double>;

/// Scalar product, summed from x to z.
template <class Real>
Real dot(const VectorOf<Real>& a, const VectorOf<Real>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Squared length of a x b, each component formed once.
template <class Real>
Real crossSquared(const VectorOf<Real>& a, const VectorOf<Real>& b) {
  const Real x = a[1] * b[2] - a[2] * b[1];
  const Real y = a[2] * b[0] - a[0] * b[2];
  const Real z = a[0] * b[1] - a[1] * b[0];
  return x * x + y * y + z * z;
}

}  // namespace ball_sim::core
