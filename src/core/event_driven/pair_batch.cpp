#include "event_driven/pair_batch.hpp"

// The loader takes the widest version that the processor can run.
#if defined(__x86_64__) && defined(__gnu_linux__)
#define BALL_SIM_WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define BALL_SIM_WIDEST
#endif

namespace ball_sim::core {

BALL_SIM_WIDEST void findImpacts(PairBatch<double>& batch, const double* x, const double* v,
                                 double radius, double now) {
  findImpactsInline(batch, x, v, radius, now);
}

void findImpacts(PairBatch<long double>& batch, const long double* x, const long double* v,
                 long double radius, long double now) {
  findImpactsInline(batch, x, v, radius, now);
}

}  // namespace ball_sim::core
