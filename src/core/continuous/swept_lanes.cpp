#include "continuous/swept_lanes.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

// Vectors are the compiler's, and pass between functions that are all inlined: in which registers
// others would pass them does not matter.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

namespace ball_sim::core {
namespace {

// Share of squares by which single precision may falsify sums of three: 16 roundings.
constexpr float kSlack = 1e-6F;

// As many lanes as most runs are long; narrower instructions take them in parts.
constexpr std::uint32_t kLanes = SweptLanes::kWidth;
typedef float Floats __attribute__((vector_size(4 * kLanes)));        // NOLINT(modernize-use-using)
typedef std::int32_t Flags __attribute__((vector_size(4 * kLanes)));  // NOLINT(modernize-use-using)

namespace plain {
inline __attribute__((always_inline)) unsigned bitsOf(const Flags& flags) {
  unsigned bits = 0;
#if defined(__x86_64__)
  for (unsigned i = 0; i < kLanes / 4; ++i) {
    __m128 part;
    std::memcpy(&part, reinterpret_cast<const char*>(&flags) + 16 * i, 16);
    bits |= static_cast<unsigned>(_mm_movemask_ps(part)) << (4 * i);
  }
#else
  for (unsigned i = 0; i < kLanes; ++i) bits |= (flags[i] & 1U) << i;
#endif
  return bits;
}

#include "continuous/swept_lanes_kernel.inc"
}  // namespace plain

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define BALL_SIM_WIDER

#pragma GCC push_options
#pragma GCC target("avx2")
namespace avx2 {
inline __attribute__((always_inline)) unsigned bitsOf(const Flags& flags) {
  unsigned bits = 0;
  for (unsigned i = 0; i < kLanes / 8; ++i) {
    __m256 part;
    std::memcpy(&part, reinterpret_cast<const char*>(&flags) + 32 * i, 32);
    bits |= static_cast<unsigned>(_mm256_movemask_ps(part)) << (8 * i);
  }
  return bits;
}

#include "continuous/swept_lanes_kernel.inc"
}  // namespace avx2
#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("avx512f,avx512dq")
namespace avx512 {
inline __attribute__((always_inline)) unsigned bitsOf(const Flags& flags) {
  return static_cast<unsigned>(_mm512_movepi32_mask((__m512i)flags));  // NOLINT: the bits
}

#include "continuous/swept_lanes_kernel.inc"
}  // namespace avx512
#pragma GCC pop_options
#endif

using Find = std::size_t (*)(const SweptLanes&, const SweptSphere&, const LaneRun*, std::size_t,
                             LaneHit*);

// The widest version that the processor can run.
Find widest() {
#if defined(BALL_SIM_WIDER)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")) {
    return avx512::findInRuns;
  }
  if (__builtin_cpu_supports("avx2")) return avx2::findInRuns;
#endif
  return plain::findInRuns;
}

}  // namespace

std::size_t findOverlaps(const SweptLanes& lanes, const SweptSphere& sphere, const LaneRun* runs,
                         std::size_t count, LaneHit* hits) {
  static const Find kFind = widest();
  return kFind(lanes, sphere, runs, count, hits);
}

}  // namespace ball_sim::core
