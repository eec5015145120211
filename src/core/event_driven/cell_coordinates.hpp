// Which cell is meant.
#pragma once

#include <array>
#include <cstdint>

namespace ball_sim::core {

/// Coordinates of a cell along the axes, in cells of one depth.
using CellCoordinates = std::array<std::int32_t, 3>;

/// The cell of a coarser depth around a cell. @param halvings  by which that one is coarser
inline CellCoordinates coarserCell(const CellCoordinates& c, int halvings) {
  return {c[0] >> halvings, c[1] >> halvings, c[2] >> halvings};
}

}  // namespace ball_sim::core
