// How much memory an array takes.
#pragma once

#include <cstddef>

namespace ball_sim::core {

/// Memory that a vector holds, bytes, used or not.
template <class Vector>
std::size_t capacityBytes(const Vector& v) {
  return v.capacity() * sizeof(typename Vector::value_type);
}

}  // namespace ball_sim::core
