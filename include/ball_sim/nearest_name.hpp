// The known name a mistyped one was probably meant to be.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace ball_sim::core {

/// @return the known name with the fewest edits (Levenshtein) from `name`; nothing when even that
/// takes more than a third of its letters
std::optional<std::string> nearestName(const std::string& name,
                                       const std::vector<std::string>& known);

}  // namespace ball_sim::core
