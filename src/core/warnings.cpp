#include "ball_sim/warnings.hpp"

namespace ball_sim::core {

std::string policyWarning(const World& world) {
  const std::uint64_t count = world.statistics().ambiguous_impacts;
  if (count == 0) return "";
  const bool in_turn = world.scene().simultaneous_impacts == SimultaneousImpacts::sequential;
  return "impacts at one instant share a ball, and the laws of impact leave open how they end (" +
         std::to_string(count) + " so far): simultaneous_impacts is " +
         (in_turn ? "sequential, 'simultaneous'" : "simultaneous, 'sequential'") +
         " would lead elsewhere";
}

}  // namespace ball_sim::core
