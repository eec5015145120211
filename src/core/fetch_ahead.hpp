// Asking memory for what will be needed.
#pragma once

namespace ball_sim::core {

/// Fetches the cache line at an address, and does not wait for it.
inline void fetchAhead(const void* address) {
  __builtin_prefetch(address);
  // GCC takes a function that only prefetches for one that does nothing, and drops calls of it.
  asm volatile("" : : "r"(address));
}

}  // namespace ball_sim::core
