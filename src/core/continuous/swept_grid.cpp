#include "continuous/swept_grid.hpp"

namespace ball_sim::core {
namespace {

// Cells are as wide as two first paths of a level reach, and so much more that they stay so while
// the longest path changes: a ball meets others in the cells beside its own at most.
constexpr double kMoreWidth = 1.15;
constexpr double kBallsPerCell = 3;  // and hold no fewer, unless they are few
constexpr double kFewCells = 64;

// What testing a path costs, in searches of a level that find nothing: measured.
constexpr double kCostOfTest = 0.05;

// The longest path of a frame, and a little more, so that a ball that is hit may become the
// fastest.
constexpr double kMoreWay = 1.125;

// Share of the largest coordinate that single precision may falsify in a path: 16 roundings.
constexpr double kMargin = 0x1p-20;

// Cells from the origin of an open axis; further away all balls share one.
constexpr double kFarthestCell = 0x1p30;

double power(double x, int n) { return n == 3 ? x * x * x : (n == 2 ? x * x : x); }

// Balls within reach of a ball, of so many in a volume.
double occupancy(double count, double reach, int dimension, double volume) {
  return std::min(count, count * power(2 * reach, dimension) / volume);
}

// The smallest sphere around two, and a margin.
SweptSphere around(const SweptSphere& a, const SweptSphere& b, float margin) {
  const float x = b.x - a.x, y = b.y - a.y, z = b.z - a.z;
  const float distance = std::sqrt(x * x + y * y + z * z);
  if (distance + b.r <= a.r) return a;
  if (distance + a.r <= b.r) return b;
  const float r = (distance + a.r + b.r) / 2;
  const float share = (r - a.r) / distance;
  return {a.x + share * x, a.y + share * y, a.z + share * z, r + margin};
}

}  // namespace

double SweptGrid::volume() const {
  double volume = 1;
  for (std::size_t k = 0; k < 3; ++k) {
    if (axes_[k].kind != SweptAxis::Kind::flat) volume *= extent_[k];
  }
  return volume;
}

void SweptGrid::chooseLevels(const std::array<Bin, kBins>& bins) {
  // From fine to coarse: what is not worth a level of its own goes with the next coarser one.
  levels_.clear();
  groups_.clear();
  for (std::size_t i = 0; i < bins.size(); ++i) {
    const Bin& bin = bins[i];
    if (bin.count == 0) continue;
    if (!groups_.empty()) {
      const Bin& finer = groups_.back();
      const double more = occupancy(finer.count, 2 * bin.reach, dimension(), volume()) -
                          occupancy(finer.count, 2 * finer.reach, dimension(), volume());
      if (kCostOfTest * finer.count * more <= finer.count + bin.count) {
        groups_.back() = {finer.count + bin.count, bin.reach};
        continue;
      }
      levels_.back().top = std::ldexp(1.0, static_cast<int>(i) - 1 - kBins / 2);
    }
    groups_.push_back(bin);
    levels_.emplace_back();
  }
  if (levels_.empty()) {
    levels_.emplace_back();
    groups_.push_back({0, 1});
  }
  unit_ = groups_.back().reach;
  per_unit_ = 1 / unit_;
  cells_ = 0;
  for (std::size_t i = 0; i < levels_.size(); ++i) {
    cut(levels_[i], groups_[i]);
    levels_[i].first_cell = cells_;
    cells_ +=
        static_cast<std::uint32_t>(levels_[i].cells[0] * levels_[i].cells[1] * levels_[i].cells[2]);
  }
  chooseSeekers();
}

double SweptGrid::edgeFor(const Bin& bin) const { return kMoreWidth * 2 * (bin.reach - planned_); }

void SweptGrid::cut(Level& level, const Bin& bin) const {
  const double most = std::max(bin.count / kBallsPerCell, kFewCells);
  double edge = edgeFor(bin);
  const auto countAlong = [&](std::size_t k) -> double {
    if (axes_[k].kind == SweptAxis::Kind::flat) return 1;
    const double wanted = std::max(1.0, std::floor(extent_[k] / edge));
    if (axes_[k].kind != SweptAxis::Kind::open) return wanted;
    return std::exp2(std::ceil(std::log2(std::max(wanted, 4.0))));
  };
  while (countAlong(0) * countAlong(1) * countAlong(2) > most) edge *= 1.125;
  for (std::size_t k = 0; k < 3; ++k) {
    if (axes_[k].kind == SweptAxis::Kind::flat) continue;
    const double count = countAlong(k);
    level.cells[k] = static_cast<Cell>(count);
    const bool open = axes_[k].kind == SweptAxis::Kind::open;
    const double width = open ? edge : axes_[k].length / count;
    level.inverse_edge[k] = unit_ / width;
    const bool closed = axes_[k].kind == SweptAxis::Kind::closed;
    level.low[k] = closed ? 0 : -kFarthestCell;
    level.high[k] = closed ? count - 1 : kFarthestCell;
    level.home_offset[k] = open ? kFarthestCell : 0;
    level.home_high[k] = open ? 2 * kFarthestCell - 1 : count - 1;
    level.home_mask[k] = open ? level.cells[k] - 1 : ~Cell{0};  // of a power of two
  }
}

// Of two levels the one looks for the other's balls for which that is less work.
void SweptGrid::chooseSeekers() {
  const std::size_t count = levels_.size();
  seeks_.assign(count * count, 0);
  for (std::size_t fine = 0; fine < count; ++fine) {
    for (std::size_t coarse = fine + 1; coarse < count; ++coarse) {
      const double reach = groups_[fine].reach + groups_[coarse].reach;
      const auto cost = [&](const Bin& seeker, const Bin& sought) {
        const double rows = power(2 * reach / edgeFor(sought) + 1, dimension() - 1);
        return seeker.count *
               (rows / 9 + kCostOfTest * occupancy(sought.count, reach, dimension(), volume()));
      };
      const bool up = cost(groups_[fine], groups_[coarse]) <= cost(groups_[coarse], groups_[fine]);
      seeks_[up ? fine * count + coarse : coarse * count + fine] = 1;
    }
  }
}

void SweptGrid::countWorkers(unsigned workers) {
  if (workers_.size() != workers) workers_ = std::vector<Worker>(workers);
}

// From what the workers have counted to where in memory each of them puts each cell's balls.
void SweptGrid::sumUp() {
  std::uint32_t position = 0;
  std::size_t key = 0;
  for (Level& level : levels_) {
    level.begin = position;
    const std::size_t end =
        level.first_cell +
        static_cast<std::size_t>(level.cells[0] * level.cells[1] * level.cells[2]);
    for (; key < end; ++key) {
      for (Worker& worker : workers_) {
        const std::uint32_t count = worker.ends[key + 1];
        worker.ends[key + 1] = position;
        position += count;
      }
    }
    level.end = position;
  }
  double farthest = 0;
  for (std::size_t k = 0; k < 3; ++k) farthest = std::max(farthest, axes_[k].length / unit_);
  longest_ = 0;
  for (const Worker& worker : workers_) {
    farthest = std::max(farthest, double(worker.farthest));
    longest_ = std::max(longest_, worker.longest);
  }
  margin_ = static_cast<float>(kMargin * (farthest + longest_ / unit_));
  for (std::size_t i = 0; i < levels_.size(); ++i) {
    double radius = 0;
    for (const Worker& worker : workers_) radius = std::max(radius, worker.radius[i]);
    levels_[i].reach = radius + longest_;
    levels_[i].reach_later = levels_[i].reach;
    levels_[i].farthest = radius + kMoreWay * 2 * longest_;
    setNear(levels_[i]);
  }
}

void SweptGrid::setNear(Level& level) const {
  const double first = 2 * (level.reach / unit_ + double(margin_));
  // To each side a path, which is within reach of its middle, and the reach of what it may meet.
  const double widest = 4 * (level.farthest / unit_ + double(margin_));
  level.has_ahead = true;
  for (std::size_t k = 0; k < 3; ++k) {
    const double cells = std::min(std::ceil(first * level.inverse_edge[k]), kFarthestCell / 4);
    level.near[k] = static_cast<Cell>(cells);
    const bool open = axes_[k].kind == SweptAxis::Kind::open;
    const double most = std::max(2 * cells, widest * level.inverse_edge[k]) + 2;
    if (open && most >= static_cast<double>(level.cells[k])) level.has_ahead = false;
  }
}

SweptGrid::CellBox SweptGrid::boxAround(const Level& level, const SweptBall& ball) const {
  const double around = (ball.radius + level.reach_later.value()) * per_unit_ + 2 * double(margin_);
  const auto along = [&](std::size_t k) -> Range {
    const double middle = double(inUnits(ball.middle[k] - axes_[k].origin));
    const double half = std::abs(ball.half[k]) * per_unit_ + around;
    const Range range = {cellOf(level, k, middle - half), cellOf(level, k, middle + half)};
    const Cell last = level.cells[k] - 1;
    const bool all = range.last - range.first >= last && axes_[k].kind == SweptAxis::Kind::open;
    return all ? Range{0, last} : range;
  };
  return {along(0), along(1), along(2)};
}

// Rows of cells; most often no axis is wrapped around.
void SweptGrid::addBox(const Level& level, const CellBox& box, SweptSearch& search) const {
  const auto& [x, y, z] = box;
  const std::array<Cell, 3>& cells = level.cells;
  const std::uint32_t* const all = begins() + level.first_cell;
  if (x.first < 0 || y.first < 0 || z.first < 0 || x.last >= cells[0] || y.last >= cells[1] ||
      z.last >= cells[2]) {
    for (Cell layer = z.first; layer <= z.last; ++layer) {
      const Image iz = imageOfCell(layer, cells[2]);
      for (Cell row = y.first; row <= y.last; ++row) {
        const Image iy = imageOfCell(row, cells[1]);
        addWrapped(level, all + (iz.cell * cells[1] + iy.cell) * cells[0], x, shiftOf(1, iy.turns),
                   shiftOf(2, iz.turns), search);
      }
    }
    return;
  }
  search.makeRoom(static_cast<std::size_t>((z.last - z.first + 1) * (y.last - y.first + 1)));
  LaneRun* next = search.runs.data() + search.run_count;
  const Cell width = x.last - x.first + 1;
  std::size_t lanes = 0;
  for (Cell layer = z.first; layer <= z.last; ++layer) {
    const std::uint32_t* row = all + (layer * cells[1] + y.first) * cells[0] + x.first;
    for (Cell k = y.first; k <= y.last; ++k, row += cells[0]) {
      *next = {row[0], row[width], 0, 0, 0};
      lanes += row[width] - row[0];
      next += row[0] < row[width] ? 1 : 0;
    }
  }
  search.run_count = static_cast<std::size_t>(next - search.runs.data());
  search.lane_count += lanes;
}

// The cells of a row as they go on from image to image.
void SweptGrid::addWrapped(const Level& level, const std::uint32_t* begins, Range x, float sy,
                           float sz, SweptSearch& search) const {
  const Cell count = level.cells[0];
  for (Cell first = x.first; first <= x.last;) {
    const Image image = imageOfCell(first, count);
    const Cell last = std::min(x.last, image.turns * count + count - 1);
    const LaneRun run = {begins[image.cell], begins[last - image.turns * count + 1],
                         shiftOf(0, image.turns), sy, sz};
    search.makeRoom(1);
    search.runs[search.run_count] = run;
    search.run_count += run.begin < run.end ? 1 : 0;
    search.lane_count += run.end - run.begin;
    first = last + 1;
  }
}

bool SweptGrid::gatherAround(std::size_t index, const SweptBall& a, const SweptBall& b,
                             SweptSearch& search) const {
  const Level& level = levels_[index];
  CellBox box = boxAround(level, a);
  if (&a != &b) {
    const CellBox other = boxAround(level, b);
    if (!join(box.x, other.x) || !join(box.y, other.y) || !join(box.z, other.z)) return false;
  }
  search.run_count = search.lane_count = 0;
  search.ahead_of = SweptSearch::kNoCell;
  addBox(level, box, search);
  search.hits.makeRoom(search.lane_count + SweptLanes::kWidth);
  return true;
}

bool SweptGrid::join(Range& range, const Range& other) {
  if (range.last < other.first || other.last < range.first) return false;
  range = {std::min(range.first, other.first), std::max(range.last, other.last)};
  return true;
}

void SweptGrid::findGathered(const SweptBall& ball, SweptSearch& search) const {
  findInRuns(lanes_, sphereOf(ball), search.runs.data(), search.run_count, search.hits);
}

std::size_t SweptGrid::findAhead(std::size_t first, std::size_t last, SweptSearch& search) const {
  const Level& level = levels_[levelAt(first)];
  search.cell = cellAt(first, search.cell);
  if (search.cell != search.ahead_of) {
    runsAhead(search.cell, level, search);
    gatherRuns(lanes_, search.runs.data(), search.run_count, search.ahead);
  }
  const std::size_t begin = begins()[search.cell];
  const std::size_t end = std::min(last, std::size_t{begins()[search.cell + 1]});
  const SweptSphere* const spheres = first_.data() + first;
  LaneHits& hits = search.hits;
  if (level.has_ahead) {  // the block begins with this cell
    findInBlock(search.ahead, spheres, end - first, first - begin + 1, 1, hits);
  } else {
    findInBlock(search.ahead, spheres, end - first, 0, 0, hits);
    dropBehind(first, search);
  }
  return end;
}

void SweptGrid::dropBehind(std::size_t first, SweptSearch& search) {
  LaneHits& hits = search.hits;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < hits.count; ++i) {
    if (search.ahead.origins[hits.lanes[i]] <= first + hits.sources[i]) continue;
    hits.sources[kept] = hits.sources[i];
    hits.lanes[kept++] = hits.lanes[i];
  }
  hits.count = kept;
}

// Ahead is: the rest of the own row, then the rows that follow; or everywhere, where a search may
// reach around an open axis.
void SweptGrid::runsAhead(std::uint32_t key, const Level& level, SweptSearch& search) const {
  search.run_count = search.lane_count = 0;
  search.ahead_of = key;
  const auto index = static_cast<Cell>(key - level.first_cell);
  const Cell x = index % level.cells[0];
  const Cell y = index / level.cells[0] % level.cells[1];
  const Cell z = index / level.cells[0] / level.cells[1];
  const Range along_x = nearOf(level, 0, x);
  const Range along_y = nearOf(level, 1, y);
  const Range along_z = nearOf(level, 2, z);
  if (level.has_ahead) {
    addBox(level, {{x, along_x.last}, {y, y}, {z, z}}, search);
    addBox(level, {along_x, {y + 1, along_y.last}, {z, z}}, search);
    addBox(level, {along_x, along_y, {z + 1, along_z.last}}, search);
  } else {
    addBox(level, {along_x, along_y, along_z}, search);
  }
}

SweptGrid::Range SweptGrid::nearOf(const Level& level, std::size_t k, Cell cell) const {
  const Cell last = level.cells[k] - 1;
  Range range = {cell - level.near[k], cell + level.near[k]};
  if (axes_[k].kind == SweptAxis::Kind::closed) {
    range = {std::max(range.first, Cell{0}), std::min(range.last, last)};
  }
  if (axes_[k].kind == SweptAxis::Kind::open && range.last - range.first >= last) return {0, last};
  return range;
}

std::array<std::int16_t, 3> SweptGrid::imageOf(const LaneRun& run) const {
  const std::array<float, 3> shift = {run.sx, run.sy, run.sz};
  std::array<std::int16_t, 3> image = {0, 0, 0};
  for (std::size_t k = 0; k < 3; ++k) {
    if (axes_[k].kind != SweptAxis::Kind::periodic) continue;
    image[k] = static_cast<std::int16_t>(std::lround(double(shift[k]) * unit_ / axes_[k].length));
  }
  return image;
}

// Lets searches reach as far as a path leads, given where the ball began the frame, unless that is
// too far.
bool SweptGrid::staysNear(std::size_t p, const SweptSphere& sphere) {
  const SweptSphere& first = first_[p];
  const double x = double(sphere.x - first.x), y = double(sphere.y - first.y),
               z = double(sphere.z - first.z);
  // Of the two margins that searches add, one is in the sphere's radius already.
  const double reach =
      (std::sqrt(x * x + y * y + z * z) + double(sphere.r) - 1.5 * double(margin_)) * unit_;
  Level& level = levels_[levelAt(p)];
  if (!(reach <= level.farthest)) return false;
  level.reach_later.note(reach);
  return true;
}

bool SweptGrid::change(std::size_t p, const SweptBall& ball) {
  const SweptSphere sphere = sphereOf(ball);
  if (!staysNear(p, sphere)) return false;
  lanes_.set(p, sphere);
  return true;
}

bool SweptGrid::add(std::size_t p, const SweptBall& ball) {
  const SweptSphere sphere = sphereOf(ball);
  if (!staysNear(p, sphere)) return false;
  lanes_.set(p, around(lanes_.at(p), sphere, margin_));
  return true;
}

}  // namespace ball_sim::core
