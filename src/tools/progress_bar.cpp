// How far a run is, for people who wait.
#include "progress_bar.hpp"

#include <unistd.h>

#include <cstdio>
#include <string>

namespace ball_sim::core {
namespace {

constexpr std::size_t kWidth = 40;  // characters

// Ten pictures a second are smooth; in a log, a line every few seconds is enough.
constexpr std::chrono::milliseconds kTerminalPeriod(100);
constexpr std::chrono::milliseconds kLogPeriod(2000);

}  // namespace

ProgressBar::ProgressBar(double until, bool asked)
    : until_(until),
      terminal_(isatty(STDERR_FILENO) == 1),
      shown_(terminal_ || asked),
      start_(Clock::now()),
      last_(start_) {}

void ProgressBar::show(double time) {
  if (!shown_) return;
  const Clock::time_point now = Clock::now();
  if (now - last_ < (terminal_ ? kTerminalPeriod : kLogPeriod)) return;
  last_ = now;
  draw(time);
}

void ProgressBar::finish(double time) {
  if (!shown_) return;
  draw(time);
  if (terminal_) std::fputc('\n', stderr);
}

void ProgressBar::draw(double time) {
  const double share = time / until_;
  const auto full = static_cast<std::size_t>(share * kWidth);
  const std::string bar = std::string(full, '=') + std::string(kWidth - full, ' ');
  const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
  std::fprintf(stderr, "%s[%s] %5.1f %%  %.6g of %.6g s  (%.1f s)%s", terminal_ ? "\r" : "",
               bar.c_str(), 100 * share, time, until_, seconds, terminal_ ? "\033[K" : "\n");
}

}  // namespace ball_sim::core
