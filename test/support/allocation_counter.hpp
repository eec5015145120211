// Counts what a test program allocates by new, and by aligned_alloc as the vectors aligned for huge
// pages do (huge_page_vector.hpp), so that a test can tell that nothing is.
//
// Replaces the global operators of the whole program: include it in one source file only. The
// linker puts the counter before aligned_alloc (test/CMakeLists.txt).
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace ball_sim::core {
namespace test {

/// Calls of new and aligned_alloc since the program began, on all threads.
inline std::atomic<long> allocations{0};

namespace detail {

inline void* allocate(std::size_t size) noexcept {
  ++allocations;
  return std::malloc(size == 0 ? 1 : size);
}

inline void* allocate(std::size_t size, std::align_val_t alignment) noexcept {
  const auto step = static_cast<std::size_t>(alignment);
  return std::aligned_alloc(step, (size + step - 1) / step * step);
}

inline void* orThrow(void* memory) {
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace detail
}  // namespace test
}  // namespace ball_sim::core

// The names that the linker gives to a wrapper, and to what it wraps.
// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming)
extern "C" {
void* __real_aligned_alloc(std::size_t alignment, std::size_t size);
void* __wrap_aligned_alloc(std::size_t alignment, std::size_t size);
void* __wrap_aligned_alloc(std::size_t alignment, std::size_t size) {
  ++ball_sim::core::test::allocations;
  return __real_aligned_alloc(alignment, size);
}
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)

// GCC takes free() in these for a mistake where it has inlined one of the pair but not the other.
#if defined(__GNUC__) && __GNUC__ >= 11 && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"
#endif

void* operator new(std::size_t size) {
  return ball_sim::core::test::detail::orThrow(ball_sim::core::test::detail::allocate(size));
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return ball_sim::core::test::detail::orThrow(
      ball_sim::core::test::detail::allocate(size, alignment));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return ball_sim::core::test::detail::allocate(size);
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
