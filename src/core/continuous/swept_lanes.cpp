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

// Notes hits that come as bits, one by one.
inline __attribute__((always_inline)) void append(unsigned bits, std::uint32_t begin,
                                                  std::uint32_t source, std::uint32_t* lanes,
                                                  std::uint32_t* sources) {
  for (; bits != 0; bits &= bits - 1) {
    *sources++ = source;
    *lanes++ = begin + static_cast<unsigned>(__builtin_ctz(bits));
  }
}

namespace plain {
typedef float Floats __attribute__((vector_size(16)));  // NOLINT(modernize-use-using)

inline __attribute__((always_inline)) Floats multiplyAdd(Floats a, Floats b, Floats c) {
  return a * b + c;
}

inline __attribute__((always_inline)) unsigned bitsOfGreater(Floats a, Floats b) {
#if defined(__x86_64__)
  return static_cast<unsigned>(_mm_movemask_ps(_mm_cmpgt_ps(a, b)));
#else
  const auto flags = a > b;
  return (flags[0] & 1U) | (flags[1] & 2U) | (flags[2] & 4U) | (flags[3] & 8U);
#endif
}

#include "continuous/swept_lanes_kernel.inc"
}  // namespace plain

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define BALL_SIM_WIDER

#pragma GCC push_options
#pragma GCC target("avx2,fma,popcnt")
namespace avx2 {
typedef float Floats __attribute__((vector_size(32)));  // NOLINT(modernize-use-using)

inline __attribute__((always_inline)) Floats multiplyAdd(Floats a, Floats b, Floats c) {
  return _mm256_fmadd_ps(a, b, c);
}

inline __attribute__((always_inline)) unsigned bitsOfGreater(Floats a, Floats b) {
  return static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_GT_OQ)));
}

#include "continuous/swept_lanes_kernel.inc"
}  // namespace avx2
#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("avx512f,popcnt")
namespace avx512 {
typedef float Floats __attribute__((vector_size(64)));  // NOLINT(modernize-use-using)

inline __attribute__((always_inline)) Floats multiplyAdd(Floats a, Floats b, Floats c) {
  return _mm512_fmadd_ps(a, b, c);
}

inline __attribute__((always_inline)) unsigned bitsOfGreater(Floats a, Floats b) {
  return _mm512_cmp_ps_mask(a, b, _CMP_GT_OQ);
}

// All at once: of the vectors that are written the first numbers are hits.
inline __attribute__((always_inline)) void append(unsigned bits, std::uint32_t begin,
                                                  std::uint32_t source, std::uint32_t* lanes,
                                                  std::uint32_t* sources) {
  const __m512i steps = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const __m512i all = _mm512_add_epi32(_mm512_set1_epi32(static_cast<int>(begin)), steps);
  const auto mask = static_cast<__mmask16>(bits);
  _mm512_storeu_si512(lanes, _mm512_maskz_compress_epi32(mask, all));
  _mm512_storeu_si512(sources, _mm512_set1_epi32(static_cast<int>(source)));
}

#include "continuous/swept_lanes_kernel.inc"
}  // namespace avx512
#pragma GCC pop_options
#endif

struct Kernels {
  decltype(&plain::findInRuns) find_in_runs;
  decltype(&plain::gather) gather;
  decltype(&plain::findInBlock) find_in_block;
};

// The widest version that the processor can run.
Kernels widest() {
#if defined(BALL_SIM_WIDER)
  __builtin_cpu_init();
  const bool counts = __builtin_cpu_supports("popcnt");
  if (counts && __builtin_cpu_supports("avx512f")) {
    return {avx512::findInRuns, avx512::gather, avx512::findInBlock};
  }
  if (counts && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    return {avx2::findInRuns, avx2::gather, avx2::findInBlock};
  }
#endif
  return {plain::findInRuns, plain::gather, plain::findInBlock};
}

const Kernels& kernels() {
  static const Kernels kWidest = widest();
  return kWidest;
}

}  // namespace

void findInRuns(const SweptLanes& lanes, const SweptSphere& sphere, const LaneRun* runs,
                std::size_t count, LaneHits& hits) {
  kernels().find_in_runs(lanes, sphere, runs, count, hits);
}

void gatherRuns(const SweptLanes& lanes, const LaneRun* runs, std::size_t count, LaneBlock& block) {
  block.count = 0;
  for (std::size_t k = 0; k < count; ++k) block.count += runs[k].end - runs[k].begin;
  if (block.lanes.x.size() < block.count + 2 * SweptLanes::kWidth) {
    block.lanes.resize(2 * block.count + SweptLanes::kWidth);
    block.origins.resize(block.lanes.x.size());
  }
  kernels().gather(lanes, runs, count, block);
}

void findInBlock(const LaneBlock& block, const SweptSphere* spheres, std::size_t count,
                 std::size_t begin, std::size_t step, LaneHits& hits) {
  kernels().find_in_block(block, spheres, count, begin, step, hits);
}

}  // namespace ball_sim::core
