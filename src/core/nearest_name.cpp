// The known name a mistyped one was probably meant to be.
#include "ball_sim/nearest_name.hpp"

#include <algorithm>
#include <numeric>

namespace ball_sim::core {
namespace {

// Fewest insertions, deletions and substitutions from a to b. Source: Levenshtein (1966); Wagner,
// Fischer (1974).
std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row.back();
}

}  // namespace

std::optional<std::string> nearestName(const std::string& name,
                                       const std::vector<std::string>& known) {
  // No name of ours is that long: nothing is near, and nothing slow is done about it.
  if (name.size() > 64) return std::nullopt;
  std::optional<std::string> nearest;
  std::size_t fewest = 0;
  for (const std::string& candidate : known) {
    const std::size_t edits = editDistance(name, candidate);
    if (edits > std::max<std::size_t>(2, candidate.size() / 3)) continue;
    if (!nearest || edits < fewest) {
      nearest = candidate;
      fewest = edits;
    }
  }
  return nearest;
}

}  // namespace ball_sim::core
