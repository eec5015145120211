// The CSV files of ball_sim_run.
#pragma once

#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>

#include "ball_sim/ball.hpp"
#include "ball_sim/method.hpp"

namespace ball_sim::core {

/// A file that could not be opened or written; what() names it and the reason.
class OutputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A text file for writing that tells of every failure.
class OutputFile {
 public:
  /// Opens and empties the file. @throws OutputError
  explicit OutputFile(const std::string& path);

  std::FILE* handle() { return file_.get(); }
  void write(const std::string& text);

  /// Hands all that was written to the system. @throws OutputError
  void flush();

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::string path_;
  std::unique_ptr<std::FILE, Close> file_;
};

/// time,id,x,y,z,vx,vy,vz: a line a ball and instant.
class StatesFile {
 public:
  explicit StatesFile(const std::string& path);
  void add(const BallStates& states);

 private:
  OutputFile file_;
};

/// time,a,b,nx,ny,nz,impulse: a line an impact.
class EventsFile {
 public:
  explicit EventsFile(const std::string& path);

  /// Writes the log's entries and empties it.
  void take(CollisionLog& log);

 private:
  OutputFile file_;
};

}  // namespace ball_sim::core
