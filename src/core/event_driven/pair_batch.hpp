// Many pairs at once: the times of impact of one ball with a batch of others.
//
// The balls near one ball are copied side by side, so that one loop without branches serves them
// all, several to an instruction. The arithmetic is that of timeOfImpact(), operation by operation,
// and so are the bits, whatever instruction set runs it.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "ball_sim/time_of_impact.hpp"
#include "ball_sim/vector.hpp"

namespace ball_sim::core {

template <class Real>
struct PairBatch {
  static constexpr std::size_t kCapacity = 64;
  static constexpr std::size_t kLanes = 8;  // of the widest instructions; loops run in whole lanes

  using Lane = std::array<Real, kCapacity>;

  // In: the others, each at its own time.
  alignas(64) Lane x{}, y{}, z{};     // m
  alignas(64) Lane vx{}, vy{}, vz{};  // m/s
  alignas(64) Lane time{};            // s
  alignas(64) Lane radius{};          // m
  std::size_t count = 0;

  // Out: time from `now` to the impact, kNever where there is none.
  alignas(64) Lane wait{};  // s

  /// Copies bodies side by side: eight numbers each, place, velocity, time, radius.
  /// @param bodies  all of them, 8 numbers apart
  /// @param slots   which ones; their number becomes `count`
  void load(const Real* bodies, const std::uint32_t* slots, std::size_t number) {
    count = number;
    std::size_t i = 0;
#if defined(__SSE2__)
    if constexpr (std::is_same_v<Real, double>) {
      for (; i + 1 < number; i += 2) loadTwo(bodies + 8 * slots[i], bodies + 8 * slots[i + 1], i);
    }
#endif
    for (; i < number; ++i) {
      const Real* body = bodies + 8 * slots[i];
      set(i, {body[0], body[1], body[2]}, {body[3], body[4], body[5]}, body[6], body[7]);
    }
  }

  void set(std::size_t i, const VectorOf<Real>& place, const VectorOf<Real>& velocity, Real at,
           Real r) {
    x[i] = place[0];
    y[i] = place[1];
    z[i] = place[2];
    vx[i] = velocity[0];
    vy[i] = velocity[1];
    vz[i] = velocity[2];
    time[i] = at;
    radius[i] = r;
  }

  void shift(std::size_t i, const VectorOf<Real>& by) {
    x[i] += by[0];
    y[i] += by[1];
    z[i] += by[2];
  }

  VectorOf<Real> placeAt(std::size_t i, Real now) const {
    const Real dt = now - time[i];
    return {x[i] + dt * vx[i], y[i] + dt * vy[i], z[i] + dt * vz[i]};
  }

#if defined(__SSE2__)
 private:
  void loadTwo(const double* a, const double* b, std::size_t i) {
    interleave(a, b, &x[i], &y[i]);
    interleave(a + 2, b + 2, &z[i], &vx[i]);
    interleave(a + 4, b + 4, &vy[i], &vz[i]);
    interleave(a + 6, b + 6, &time[i], &radius[i]);
  }

  static void interleave(const double* a, const double* b, double* firsts, double* seconds) {
    const __m128d both_a = _mm_load_pd(a);
    const __m128d both_b = _mm_load_pd(b);
    _mm_store_pd(firsts, _mm_unpacklo_pd(both_a, both_b));
    _mm_store_pd(seconds, _mm_unpackhi_pd(both_a, both_b));
  }
#endif
};

/// Fills batch.wait.
/// @param x, v    place and velocity of the one ball at `now`
/// @param radius  its radius, m
/// @param now     s
template <class Real>
inline __attribute__((always_inline)) void findImpactsInline(PairBatch<Real>& batch, const Real* x,
                                                             const Real* v, Real radius, Real now) {
  const Real x0 = x[0], x1 = x[1], x2 = x[2];
  const Real v0 = v[0], v1 = v[1], v2 = v[2];
  const std::size_t whole_lanes = (batch.count + batch.kLanes - 1) / batch.kLanes * batch.kLanes;
  for (std::size_t i = 0; i < whole_lanes; ++i) {
    const Real dt = now - batch.time[i];
    const Real dx = batch.x[i] + dt * batch.vx[i] - x0;
    const Real dy = batch.y[i] + dt * batch.vy[i] - x1;
    const Real dz = batch.z[i] + dt * batch.vz[i] - x2;
    const Real dvx = batch.vx[i] - v0;
    const Real dvy = batch.vy[i] - v1;
    const Real dvz = batch.vz[i] - v2;
    const Real reach = batch.radius[i] + radius;
    const Real b = dx * dvx + dy * dvy + dz * dvz;
    const Real c = dx * dx + dy * dy + dz * dz - reach * reach;
    const Real nx = dy * dvz - dz * dvy;
    const Real ny = dz * dvx - dx * dvz;
    const Real nz = dx * dvy - dy * dvx;
    const Real discriminant =
        (dvx * dvx + dvy * dvy + dvz * dvz) * (reach * reach) - (nx * nx + ny * ny + nz * nz);
    const Real apart = c / (std::sqrt(discriminant) - b);
    const Real meets = discriminant > 0 ? apart : kNever<Real>;
    const Real wait = c <= 0 ? Real(0) : meets;
    batch.wait[i] = b < 0 ? wait : kNever<Real>;
  }
}

/// The same, for doubles in the widest instructions the processor has.
void findImpacts(PairBatch<double>& batch, const double* x, const double* v, double radius,
                 double now);
void findImpacts(PairBatch<long double>& batch, const long double* x, const long double* v,
                 long double radius, long double now);

}  // namespace ball_sim::core
