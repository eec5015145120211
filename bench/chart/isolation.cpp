// Runs a piece of work in a process of its own.
#include "isolation.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <stdexcept>

namespace ball_sim::core::chart {
namespace {

constexpr double kPatience = 8;  // s by the clock for a second of CPU time
constexpr const char* kTooLong = "gave no result in time";

void writeAll(int file, const std::string& text) {
  std::size_t written = 0;
  while (written < text.size()) {
    const ssize_t now = write(file, text.data() + written, text.size() - written);
    if (now <= 0) _exit(1);
    written += static_cast<std::size_t>(now);
  }
}

// What engines print is no part of the report.
void silence() {
  const int nothing = open("/dev/null", O_WRONLY);
  dup2(nothing, STDOUT_FILENO);
  dup2(nothing, STDERR_FILENO);
}

void limitCpu(double seconds) {
  const auto limit = static_cast<rlim_t>(seconds);
  const rlimit both{limit, limit};
  setrlimit(RLIMIT_CPU, &both);
}

std::vector<std::string> splitLines(const std::string& text) {
  std::vector<std::string> lines;
  std::size_t begin = 0;
  for (std::size_t end; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1) {
    lines.push_back(text.substr(begin, end - begin));
  }
  return lines;
}

// Reads until the other side closes. @return false: out of time
bool readUntilClosed(int file, double seconds, std::string& text) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  std::array<char, 4096> buffer{};
  while (true) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now());
    if (left.count() <= 0) return false;
    pollfd ready{file, POLLIN, 0};
    if (poll(&ready, 1, static_cast<int>(left.count())) <= 0) continue;
    const ssize_t count = read(file, buffer.data(), buffer.size());
    if (count <= 0) return true;
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
}

}  // namespace

Outcome runIsolated(const std::function<void(const std::function<void(const std::string&)>&)>& work,
                    double seconds) {
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("pipe: " + std::string(std::strerror(errno)));
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("fork: " + std::string(std::strerror(errno)));
  if (child == 0) {
    close(ends[0]);
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // it does not outlive a report that is broken off
    silence();
    limitCpu(seconds);
    work([&](const std::string& line) { writeAll(ends[1], line + "\n"); });
    _exit(0);
  }
  close(ends[1]);
  std::string text;
  Outcome outcome;
  if (!readUntilClosed(ends[0], kPatience * seconds, text)) {
    kill(child, SIGKILL);
    outcome.failure = kTooLong;
  }
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (outcome.failure.empty() && WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    const bool is_limit = signal == SIGXCPU || signal == SIGKILL;
    outcome.failure = is_limit ? kTooLong : std::string("crashed: ") + strsignal(signal);
  } else if (outcome.failure.empty() && WEXITSTATUS(status) != 0) {
    outcome.failure = "ended itself with an error";
  }
  outcome.lines = splitLines(text);
  return outcome;
}

}  // namespace ball_sim::core::chart
