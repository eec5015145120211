// The other engines as entrants of the chart.
#pragma once

#include <vector>

#include "entrant.hpp"

namespace ball_sim::core::chart {

/// All that were built in.
std::vector<Entrant> peers();

}  // namespace ball_sim::core::chart
