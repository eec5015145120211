// Which cell is meant, and where cells lie along a space-filling curve.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace ball_sim::core {

/// Coordinates of a cell along the axes, in cells of one depth.
using CellCoordinates = std::array<std::int32_t, 3>;

/// The cell of a coarser depth around a cell. @param halvings  by which that one is coarser
inline CellCoordinates coarserCell(const CellCoordinates& c, int halvings) {
  return {c[0] >> halvings, c[1] >> halvings, c[2] >> halvings};
}

/// The place of a cell along Morton's space-filling curve (1966), which keeps near what is near.
inline std::uint64_t mortonKey(const CellCoordinates& c) {
  std::uint64_t key = 0;
  for (int bit = 0; bit < 21; ++bit) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto coordinate = static_cast<std::uint32_t>(c[static_cast<std::size_t>(axis)]);
      key |= std::uint64_t{(coordinate >> bit) & 1} << (3 * bit + axis);
    }
  }
  return key;
}

}  // namespace ball_sim::core
