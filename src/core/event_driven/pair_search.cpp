#include "event_driven/pair_search.hpp"

#include <algorithm>
#include <cmath>

#if defined(__x86_64__) && defined(__GNUC__)
#define BALL_SIM_X86_LANES
#include <immintrin.h>
// GCC 12 warns of its own intrinsics (GCC bug 105593).
#pragma GCC diagnostic ignored "-Wuninitialized"
#if !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif
#endif

namespace ball_sim::core {

// Lanes: several numbers that are handled alike. Each kind offers
//   all(a)                 the same number in every lane
//   load(bodies, slots...) one body a lane
//   less, lessOrEqual      a bit a lane, lane 0 lowest
//   nearestWhole(v)        to the nearest whole number, below 2^51 in size
//   squareRoot(v)
//   select(mask, a, b)     a in the lanes of the mask, b in the others
//   least(v)               of all lanes
//   store(to, v)

namespace one_lane {

template <class R>
struct LanesOf {
  using Real = R;
  using Vector = R;
  static constexpr std::size_t kWidth = 1;
  static Vector all(Real a) { return a; }
  static void load(const Body<Real>* bodies, const Slot* slots, Vector& x, Vector& y, Vector& z,
                   Vector& vx, Vector& vy, Vector& vz, Vector& time, Vector& radius) {
    const Body<Real>& body = bodies[slots[0]];
    x = body.x[0], y = body.x[1], z = body.x[2];
    vx = body.v[0], vy = body.v[1], vz = body.v[2];
    time = body.time, radius = body.radius;
  }
  static unsigned less(Vector a, Vector b) { return a < b ? 1 : 0; }
  static unsigned lessOrEqual(Vector a, Vector b) { return a <= b ? 1 : 0; }
  static Vector nearestWhole(Vector v) { return core::nearestWhole(v); }
  static Vector squareRoot(Vector v) { return std::sqrt(v); }
  static Vector select(unsigned mask, Vector a, Vector b) { return (mask & 1) != 0 ? a : b; }
  static Real least(Vector v) { return v; }
  static void store(Real* to, Vector v) { *to = v; }
};

namespace of_double {
using Lanes = LanesOf<double>;
#include "event_driven/pair_search_in_lanes.inc"
}  // namespace of_double

namespace of_long_double {
using Lanes = LanesOf<long double>;
#include "event_driven/pair_search_in_lanes.inc"
}  // namespace of_long_double

}  // namespace one_lane

#ifdef BALL_SIM_X86_LANES

namespace two_lanes {

struct Lanes {
  using Real = double;
  using Vector = __m128d;
  static constexpr std::size_t kWidth = 2;
  static Vector all(double a) { return _mm_set1_pd(a); }
  static void load(const Body<double>* bodies, const Slot* slots, Vector& x, Vector& y, Vector& z,
                   Vector& vx, Vector& vy, Vector& vz, Vector& time, Vector& radius) {
    const double* a = bodies[slots[0]].x.data();
    const double* b = bodies[slots[1]].x.data();
    loadTwo(a, b, x, y);
    loadTwo(a + 2, b + 2, z, vx);
    loadTwo(a + 4, b + 4, vy, vz);
    loadTwo(a + 6, b + 6, time, radius);
  }
  static void loadTwo(const double* a, const double* b, Vector& firsts, Vector& seconds) {
    const Vector from_a = _mm_load_pd(a);
    const Vector from_b = _mm_load_pd(b);
    firsts = _mm_unpacklo_pd(from_a, from_b);
    seconds = _mm_unpackhi_pd(from_a, from_b);
  }
  static unsigned less(Vector a, Vector b) {
    return static_cast<unsigned>(_mm_movemask_pd(_mm_cmplt_pd(a, b)));
  }
  static unsigned lessOrEqual(Vector a, Vector b) {
    return static_cast<unsigned>(_mm_movemask_pd(_mm_cmple_pd(a, b)));
  }
  static Vector nearestWhole(Vector v) {
    return (v + all(kWholeShift<double>)) - all(kWholeShift<double>);
  }
  static Vector squareRoot(Vector v) { return _mm_sqrt_pd(v); }
  static Vector select(unsigned mask, Vector a, Vector b) {
    const Vector m = _mm_castsi128_pd(
        _mm_set_epi64x(-static_cast<long long>(mask >> 1 & 1), -static_cast<long long>(mask & 1)));
    return _mm_or_pd(_mm_and_pd(m, a), _mm_andnot_pd(m, b));
  }
  static void store(double* to, Vector v) { _mm_store_pd(to, v); }
  static double least(Vector v) { return _mm_cvtsd_f64(_mm_min_sd(v, _mm_unpackhi_pd(v, v))); }
};

#include "event_driven/pair_search_in_lanes.inc"

}  // namespace two_lanes

#pragma GCC push_options
#pragma GCC target("avx2")

namespace four_lanes {

struct Lanes {
  using Real = double;
  using Vector = __m256d;
  static constexpr std::size_t kWidth = 4;
  static Vector all(double a) { return _mm256_set1_pd(a); }
  static void load(const Body<double>* bodies, const Slot* slots, Vector& x, Vector& y, Vector& z,
                   Vector& vx, Vector& vy, Vector& vz, Vector& time, Vector& radius) {
    const double* const rows[4] = {bodies[slots[0]].x.data(), bodies[slots[1]].x.data(),
                                   bodies[slots[2]].x.data(), bodies[slots[3]].x.data()};
    loadFour(rows, 0, x, y, z, vx);
    loadFour(rows, 4, vy, vz, time, radius);
  }
  // Columns `from` to `from` + 3 of four rows.
  static void loadFour(const double* const (&rows)[4], int from, Vector& a, Vector& b, Vector& c,
                       Vector& d) {
    const Vector row0 = _mm256_load_pd(rows[0] + from), row1 = _mm256_load_pd(rows[1] + from);
    const Vector row2 = _mm256_load_pd(rows[2] + from), row3 = _mm256_load_pd(rows[3] + from);
    const Vector even01 = _mm256_unpacklo_pd(row0, row1), odd01 = _mm256_unpackhi_pd(row0, row1);
    const Vector even23 = _mm256_unpacklo_pd(row2, row3), odd23 = _mm256_unpackhi_pd(row2, row3);
    a = _mm256_permute2f128_pd(even01, even23, 0x20);
    b = _mm256_permute2f128_pd(odd01, odd23, 0x20);
    c = _mm256_permute2f128_pd(even01, even23, 0x31);
    d = _mm256_permute2f128_pd(odd01, odd23, 0x31);
  }
  static unsigned less(Vector a, Vector b) {
    return static_cast<unsigned>(_mm256_movemask_pd(_mm256_cmp_pd(a, b, _CMP_LT_OQ)));
  }
  static unsigned lessOrEqual(Vector a, Vector b) {
    return static_cast<unsigned>(_mm256_movemask_pd(_mm256_cmp_pd(a, b, _CMP_LE_OQ)));
  }
  static Vector nearestWhole(Vector v) {
    return (v + all(kWholeShift<double>)) - all(kWholeShift<double>);
  }
  static Vector squareRoot(Vector v) { return _mm256_sqrt_pd(v); }
  static Vector select(unsigned mask, Vector a, Vector b) {
    const __m256i bits = _mm256_set_epi64x(8, 4, 2, 1);
    const __m256i chosen = _mm256_and_si256(_mm256_set1_epi64x(mask), bits);
    return _mm256_blendv_pd(b, a, _mm256_castsi256_pd(_mm256_cmpeq_epi64(chosen, bits)));
  }
  static void store(double* to, Vector v) { _mm256_store_pd(to, v); }
  static double least(Vector v) {
    const __m128d two = _mm_min_pd(_mm256_castpd256_pd128(v), _mm256_extractf128_pd(v, 1));
    return two_lanes::Lanes::least(two);
  }
};

#include "event_driven/pair_search_in_lanes.inc"

}  // namespace four_lanes

#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("avx512f")

namespace eight_lanes {

struct Lanes {
  using Real = double;
  using Vector = __m512d;
  static constexpr std::size_t kWidth = 8;
  static Vector all(double a) { return _mm512_set1_pd(a); }
  // Eight rows of eight, turned into columns: pairs, then fours, then eights.
  static void load(const Body<double>* bodies, const Slot* slots, Vector& x, Vector& y, Vector& z,
                   Vector& vx, Vector& vy, Vector& vz, Vector& time, Vector& radius) {
    const auto row = [&](int i) { return _mm512_load_pd(bodies[slots[i]].x.data()); };
    const Vector row0 = row(0), row1 = row(1), row2 = row(2), row3 = row(3);
    const Vector row4 = row(4), row5 = row(5), row6 = row(6), row7 = row(7);
    const Vector even01 = _mm512_unpacklo_pd(row0, row1), odd01 = _mm512_unpackhi_pd(row0, row1);
    const Vector even23 = _mm512_unpacklo_pd(row2, row3), odd23 = _mm512_unpackhi_pd(row2, row3);
    const Vector even45 = _mm512_unpacklo_pd(row4, row5), odd45 = _mm512_unpackhi_pd(row4, row5);
    const Vector even67 = _mm512_unpacklo_pd(row6, row7), odd67 = _mm512_unpackhi_pd(row6, row7);
    turn(even01, even23, even45, even67, x, z, vy, time);
    turn(odd01, odd23, odd45, odd67, y, vx, vz, radius);
  }
  static void turn(Vector pair01, Vector pair23, Vector pair45, Vector pair67, Vector& a, Vector& b,
                   Vector& c, Vector& d) {
    const Vector ac0 = _mm512_shuffle_f64x2(pair01, pair23, 0x88);
    const Vector bd0 = _mm512_shuffle_f64x2(pair01, pair23, 0xdd);
    const Vector ac4 = _mm512_shuffle_f64x2(pair45, pair67, 0x88);
    const Vector bd4 = _mm512_shuffle_f64x2(pair45, pair67, 0xdd);
    a = _mm512_shuffle_f64x2(ac0, ac4, 0x88);
    c = _mm512_shuffle_f64x2(ac0, ac4, 0xdd);
    b = _mm512_shuffle_f64x2(bd0, bd4, 0x88);
    d = _mm512_shuffle_f64x2(bd0, bd4, 0xdd);
  }
  static unsigned less(Vector a, Vector b) { return _mm512_cmp_pd_mask(a, b, _CMP_LT_OQ); }
  static unsigned lessOrEqual(Vector a, Vector b) { return _mm512_cmp_pd_mask(a, b, _CMP_LE_OQ); }
  static Vector nearestWhole(Vector v) {
    return (v + all(kWholeShift<double>)) - all(kWholeShift<double>);
  }
  static Vector squareRoot(Vector v) { return _mm512_sqrt_pd(v); }
  static Vector select(unsigned mask, Vector a, Vector b) {
    return _mm512_mask_blend_pd(static_cast<__mmask8>(mask), b, a);
  }
  static void store(double* to, Vector v) { _mm512_store_pd(to, v); }
  static double least(Vector v) { return _mm512_reduce_min_pd(v); }
};

#include "event_driven/pair_search_in_lanes.inc"

}  // namespace eight_lanes

#pragma GCC pop_options

#endif

template <>
std::vector<PairSearch<double>> pairSearches<double>(bool wraps, bool falls,
                                                     std::size_t most_lanes) {
  std::vector<PairSearch<double>> searches;
#ifdef BALL_SIM_X86_LANES
  if (most_lanes >= 8 && __builtin_cpu_supports("avx512f")) {
    searches.push_back(eight_lanes::pairSearch(wraps, falls));
  }
  if (most_lanes >= 4 && __builtin_cpu_supports("avx2"))
    searches.push_back(four_lanes::pairSearch(wraps, falls));
  searches.push_back(two_lanes::pairSearch(wraps, falls));
#endif
  searches.push_back(one_lane::of_double::pairSearch(wraps, falls));
  return searches;
}

template <>
std::vector<PairSearch<long double>> pairSearches<long double>(bool wraps, bool falls,
                                                               std::size_t) {
  return {one_lane::of_long_double::pairSearch(wraps, falls)};
}

template <class Real>
PairSearch<Real> choosePairSearch(bool wraps, bool falls, std::size_t most_lanes) {
  return pairSearches<Real>(wraps, falls, most_lanes).front();
}

template PairSearch<double> choosePairSearch<double>(bool wraps, bool falls, std::size_t);
template PairSearch<long double> choosePairSearch<long double>(bool wraps, bool falls, std::size_t);

}  // namespace ball_sim::core
