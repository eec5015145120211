// The CSV files of ball_sim_run. 17 significant digits bring every double back bit for bit.
#include "csv_files.hpp"

#include <cerrno>
#include <cinttypes>
#include <cstring>

namespace ball_sim::core {

OutputFile::OutputFile(const std::string& path)
    : path_(path), file_(std::fopen(path.c_str(), "w")) {
  if (!file_) throw OutputError(path + ": cannot be written: " + std::strerror(errno));
}

void OutputFile::write(const std::string& text) { std::fputs(text.c_str(), file_.get()); }

void OutputFile::flush() {
  if (std::fflush(file_.get()) != 0 || std::ferror(file_.get()) != 0) {
    throw OutputError(path_ + ": cannot be written: " + std::strerror(errno));
  }
}

StatesFile::StatesFile(const std::string& path) : file_(path) {
  file_.write("time,id,x,y,z,vx,vy,vz\n");
  file_.flush();
}

void StatesFile::add(const BallStates& states) {
  const double time = states.time.seconds();
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    const Vector3& x = states.positions[i];
    const Vector3& v = states.velocities[i];
    std::fprintf(file_.handle(), "%.17g,%" PRIu32 ",%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n", time,
                 states.ids[i], x.x(), x.y(), x.z(), v.x(), v.y(), v.z());
  }
  file_.flush();
}

EventsFile::EventsFile(const std::string& path) : file_(path) {
  file_.write("time,a,b,nx,ny,nz,impulse\n");
  file_.flush();
}

void EventsFile::take(CollisionLog& log) {
  for (const Collision& c : log.entries) {
    std::fprintf(file_.handle(), "%.17g,%" PRIu32 ",%" PRId64 ",%.17g,%.17g,%.17g,%.17g\n",
                 c.time.seconds(), c.a, c.b, c.normal.x(), c.normal.y(), c.normal.z(), c.impulse);
  }
  log.entries.clear();
  file_.flush();
}

}  // namespace ball_sim::core
