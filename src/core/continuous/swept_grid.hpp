// The broad phase of method continuous: who may meet whom within one frame.
//
// At the start of a frame every ball is put into a cell by the middle of its path, in memory too:
// balls that are near each other lie side by side, cell after cell, row after row. The grid then
// stays as it is until the frame ends; a ball that changes its path gets another bounding sphere,
// in its place. A search takes the box around a path, widened by the reach of the balls looked for
// (how far from the middle of its first path any of them may touch something), and tests all the
// bounding spheres in the cells of that box.
//
// Balls of very different radii go into different levels, each with cells of its own, so that small
// balls do not look as far as large ones reach.
//
// An axis is closed (places beyond count to the last cell), periodic (cells go on in the next image
// of the box), or open (cells are taken modulo their number: balls that share a cell by chance only
// cost a look). All of it is conservative and decides no bit of a trajectory.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "continuous/swept_lanes.hpp"
#include "continuous/worker_pool.hpp"

namespace ball_sim::core {

/// What the space of a grid is along one axis.
struct SweptAxis {
  enum class Kind { flat, closed, periodic, open };

  Kind kind = Kind::open;
  double origin = 0;  ///< m
  double length = 0;  ///< m, of a closed or periodic axis
};

/// A ball's path over a frame or the rest of one, as a grid takes it.
struct SweptBall {
  std::array<double, 3> middle;  ///< m, between begin and end of the path
  std::array<double, 3> half;    ///< m, from the middle to the end, with its sign
  double radius;                 ///< m, with what the path may lie beside a straight one
  double half_length;            ///< m, length of `half`
};

/// The largest of what threads tell.
class SharedMaximum {
 public:
  SharedMaximum() = default;
  SharedMaximum(const SharedMaximum& other) : value_(other.value()) {}
  SharedMaximum& operator=(double value) {
    value_.store(value, std::memory_order_relaxed);
    return *this;
  }

  double value() const { return value_.load(std::memory_order_relaxed); }

  void note(double value) {
    double most = this->value();
    while (value > most && !value_.compare_exchange_weak(most, value, std::memory_order_relaxed)) {
    }
  }

 private:
  std::atomic<double> value_{0};
};

/// What one search needs, kept so that nothing is allocated.
struct SweptSearch {
  std::vector<LaneRun> runs;
  std::size_t run_count = 0;
  std::size_t lane_count = 0;  ///< of all runs
  LaneHits hits;
  std::uint32_t cell = 0;            ///< where findAhead() was last
  std::uint32_t ahead_of = kNoCell;  ///< the block is what lies ahead of the balls of this cell
  LaneBlock ahead;

  static constexpr std::uint32_t kNoCell = ~std::uint32_t{0};

  void makeRoom(std::size_t more_runs) {
    if (runs.size() < run_count + more_runs) runs.resize(2 * (run_count + more_runs));
  }

  /// Where a lane of the block comes from.
  const LaneRun& runOf(std::uint32_t block_lane) const {
    std::size_t k = 0;
    while (block_lane >= runs[k].end - runs[k].begin) {
      block_lane -= runs[k].end - runs[k].begin;
      ++k;
    }
    return runs[k];
  }
};

/// Finds who may meet whom within one frame: fill it when the frame begins, search, and tell it of
/// every path that changes.
class SweptGrid {
 public:
  explicit SweptGrid(const std::array<SweptAxis, 3>& axes) : axes_(axes) {}

  /// Looks where the balls are, so that volume() and layOut() know.
  /// @param describe  gives the SweptBall of 0..count-1
  /// @param least     m, > 0: no less than that along any axis
  template <class Describe>
  void survey(std::size_t count, const Describe& describe, double least);

  /// What space the balls take, or may take, m^3 (m^2 with a flat axis).
  double volume() const;

  /// Chooses levels and cells, for frames like the one described.
  template <class Describe>
  void layOut(std::size_t count, const Describe& describe);

  /// Puts all balls into their cells. Positions in the grid's order are given out anew.
  /// @param describe  as above, for this frame
  template <class Describe>
  void fill(std::size_t count, const Describe& describe, WorkerPool& pool);

  /// Whether paths have become so long since layOut() that searches cost too much.
  bool hasOutgrownItsCells() const { return longest_ > 2 * planned_; }

  std::uint32_t slotAt(std::size_t position) const { return slots_[position]; }
  void fetchSlot(std::size_t position) const { touch(&slots_[position]); }
  const HugePageVector<std::uint32_t>& positions() const { return positions_; }  ///< by slot

  /// From now on the ball at each position has the position's own number.
  void renumber() {
    for (std::uint32_t p = 0; p < slots_.size(); ++p) slots_[p] = positions_[p] = p;
  }

  std::size_t levels() const { return levels_.size(); }
  std::size_t levelAt(std::size_t position) const {
    std::size_t level = 0;
    while (position >= levels_[level].end) ++level;
    return level;
  }

  /// Whether the balls of `level` look for those of `other`, so that each pair is looked at once.
  bool seeks(std::size_t level, std::size_t other) const {
    return seeks_[level * levels_.size() + other];
  }

  /// Where the middle of a ball's path is now taken to be, m: of a periodic box the image that lies
  /// in it at the start.
  std::array<double, 3> middleAt(std::size_t p) const {
    const SweptSphere sphere = lanes_.at(p);
    return {unit_ * double(sphere.x) + axes_[0].origin, unit_ * double(sphere.y) + axes_[1].origin,
            unit_ * double(sphere.z) + axes_[2].origin};
  }

  /// So many periods along each axis lies the image that a run shows from the one that middleAt
  /// tells.
  std::array<std::int16_t, 3> imageOf(const LaneRun& run) const;

  /// Fetches from memory what change() or add() of a ball needs.
  void fetch(std::size_t p) const {
    for (const HugePageVector<float>* lane : {&lanes_.x, &lanes_.y, &lanes_.z, &lanes_.r}) {
      touch(lane->data() + p);
    }
    touch(&first_[p]);
  }

  /// Changes the path of a ball.
  /// @return false when it leads too far from where the ball began the frame: searches would not
  ///         find it, and the frame has to end
  bool change(std::size_t p, const SweptBall& ball);

  /// Adds a path that a ball may take to the one it has; returns as change() does.
  bool add(std::size_t p, const SweptBall& ball);

  /// How far from the middle of its first path a ball may touch something, at most, m.
  double reach() const {
    double reach = 0;
    for (const Level& level : levels_) reach = std::max(reach, level.farthest);
    return reach;
  }

  /// Finds the balls of the same level that some balls may meet in this frame, each pair from one
  /// of its ends only. All balls are on their first paths.
  /// @param first, last  positions of the balls to look from; done are the first ones, of one cell
  /// @param search       takes the hits: lanes of `ahead`, of the ball at first + their source
  /// @return the first position that is not done
  std::size_t findAhead(std::size_t first, std::size_t last, SweptSearch& search) const;

  /// Finds all balls of a level that may meet a ball, by how far balls of the level have got.
  void findAround(std::size_t level, const SweptBall& ball, SweptSearch& search) const {
    gatherAround(level, ball, ball, search);
    findGathered(ball, search);
  }

  /// Gathers, for two balls, where others of a level may be that meet one of them.
  /// @return false, and nothing is gathered: they are far from each other, so look for each alone
  bool gatherAround(std::size_t level, const SweptBall& a, const SweptBall& b,
                    SweptSearch& search) const;

  /// Finds the balls that may meet a ball, one of those that was gathered for.
  void findGathered(const SweptBall& ball, SweptSearch& search) const;

  std::size_t bytes() const {
    std::size_t bytes = lanes_.bytes() + (slots_.capacity() + positions_.capacity()) * 4 +
                        first_.capacity() * sizeof(SweptSphere);
    for (const Worker& worker : workers_) bytes += worker.ends.capacity() * 4;
    return bytes;
  }

 private:
  using Cell = std::int32_t;

  struct Level {
    double top = std::numeric_limits<double>::infinity();  // m: its balls are smaller
    std::array<double, 3> inverse_edge{};                  // cells per unit
    std::array<Cell, 3> cells = {1, 1, 1};
    std::array<double, 3> low{}, high{};  // cells, limits to those a place may be in
    // For a ball's own cell: where cells are counted from, the last one, and what takes it modulo
    // the number of cells.
    std::array<double, 3> home_offset{}, home_high{};
    std::array<Cell, 3> home_mask = {0, 0, 0};
    std::uint32_t first_cell = 0;
    // No ball gets further from the middle of its first path, its radius included, m.
    double reach = 0;                  // on the first paths
    SharedMaximum reach_later;         // on those too that have followed until now
    double farthest = 0;               // on any: a limit
    std::uint32_t begin = 0, end = 0;  // positions
    std::array<Cell, 3> near{};        // balls on first paths meet none in cells further away
    bool has_ahead = true;             // no search reaches around an open axis
  };

  // What each worker counts.
  struct alignas(64) Worker {
    // By cell, from the second entry on: where its next ball goes, and at last where it ends.
    HugePageVector<std::uint32_t> ends;
    std::vector<double> radius;  // m, the largest, by level
    double longest = 0;          // m, half of the longest path
    float farthest = 0;          // unit, magnitude of any coordinate
  };

  // Cells of a box, along one axis.
  struct Range {
    Cell first, last;
  };
  struct CellBox {
    Range x, y, z;
  };
  static bool join(Range& range, const Range& other);

  // Share of a distance by which tests in single precision may falsify it: 8 roundings.
  static constexpr float kSlack = 5e-7F;

  static constexpr int kBins = 256;  // octaves of radius, 2^-128 .. 2^127 m

  // Without a branch, which std::clamp of values in memory has.
  static double clamped(double x, double low, double high) {
    x = x > low ? x : low;
    return x < high ? x : high;
  }

  static int binOf(double radius) {
    int exponent = 0;
    (void)std::frexp(radius, &exponent);
    return std::min(std::max(exponent + kBins / 2, 0), kBins - 1);
  }

  int dimension() const {
    int count = 0;
    for (const SweptAxis& axis : axes_) count += axis.kind == SweptAxis::Kind::flat ? 0 : 1;
    return count;
  }

  // --- layout; in swept_grid.cpp

  struct Bin {
    double count = 0;
    double reach = 0;  // m, the largest: radius and way, of a whole path
  };

  void chooseLevels(const std::array<Bin, kBins>& bins);
  double edgeFor(const Bin& bin) const;  // m, of a cell
  void cut(Level& level, const Bin& bin) const;
  void chooseSeekers();

  // --- cells

  std::size_t levelOf(double radius) const {
    std::size_t level = 0;
    while (!(radius < levels_[level].top)) ++level;
    return level;
  }

  // The cell of a place, not yet taken modulo the number of cells.
  static Cell cellOf(const Level& level, std::size_t k, double x) {
    const double cell = clamped(x * level.inverse_edge[k], level.low[k], level.high[k]);
    const auto whole = static_cast<Cell>(cell);
    return whole - (cell < static_cast<double>(whole) ? 1 : 0);
  }

  // The cell that holds a ball, from 0 on: in a periodic box never one of another image, not even
  // by rounding. (Counted from so far that truncation rounds down; what that rounds off is less
  // than the margin of searches.)
  static Cell homeOf(const Level& level, std::size_t k, float x) {
    const double cell = double(x) * level.inverse_edge[k] + level.home_offset[k];
    return static_cast<Cell>(clamped(cell, 0, level.home_high[k])) & level.home_mask[k];
  }

  // A cell modulo the number of cells, and how far away its image is.
  struct Image {
    Cell cell;
    Cell turns;
  };
  static Image imageOfCell(Cell cell, Cell count) {
    if (cell >= 0 && cell < count) return {cell, 0};
    const Cell turns = cell >= 0 ? cell / count : -((-cell - 1) / count) - 1;
    return {cell - turns * count, turns};
  }

  float shiftOf(std::size_t k, Cell turns) const {
    return axes_[k].kind == SweptAxis::Kind::periodic
               ? static_cast<float>(static_cast<double>(turns) * axes_[k].length / unit_)
               : 0;
  }

  __attribute__((always_inline)) static std::uint32_t keyOf(const Level& level,
                                                            const SweptSphere& sphere) {
    const Cell x = homeOf(level, 0, sphere.x);
    const Cell y = homeOf(level, 1, sphere.y);
    const Cell z = homeOf(level, 2, sphere.z);
    return level.first_cell +
           static_cast<std::uint32_t>((z * level.cells[1] + y) * level.cells[0] + x);
  }

  // Where the balls of the cells before one end: the first of that one.
  const std::uint32_t* begins() const { return workers_.back().ends.data(); }

  // --- search

  // Always in place: a call for each ball of each frame costs 2 % of a run, and GCC makes it one.
  __attribute__((always_inline)) SweptSphere sphereOf(const SweptBall& ball) const {
    return {inUnits(ball.middle[0] - axes_[0].origin), inUnits(ball.middle[1] - axes_[1].origin),
            inUnits(ball.middle[2] - axes_[2].origin),
            inUnits(ball.radius + ball.half_length) * (1 + kSlack) + margin_};
  }

  // Within single precision, whatever is asked.
  float inUnits(double length) const {
    return static_cast<float>(clamped(length * per_unit_, -1e30, 1e30));
  }

  CellBox boxAround(const Level& level, const SweptBall& ball) const;
  void addBox(const Level& level, const CellBox& box, SweptSearch& search) const;
  void addWrapped(const Level& level, const std::uint32_t* begins, Range x, float sy, float sz,
                  SweptSearch& search) const;
  void run(const SweptSphere& sphere, SweptSearch& search) const;
  bool staysNear(std::size_t p, const SweptSphere& sphere);

  // --- filling

  void countWorkers(unsigned workers);
  void sumUp();
  void setNear(Level& level) const;
  // The cell that holds a ball. Quick where it is not far behind another one.
  std::uint32_t cellAt(std::size_t position, std::uint32_t before) const {
    const std::uint32_t* const begins = this->begins();
    if (before >= cells_ || position < begins[before]) {
      const std::uint32_t* const after = std::upper_bound(begins, begins + cells_, position);
      return static_cast<std::uint32_t>(after - begins) - 1;
    }
    while (position >= begins[before + 1]) ++before;
    return before;
  }
  static void dropBehind(std::size_t first, SweptSearch& search);
  void runsAhead(std::uint32_t key, const Level& level, SweptSearch& search) const;
  Range nearOf(const Level& level, std::size_t k, Cell cell) const;

  std::array<SweptAxis, 3> axes_;
  std::array<double, 3> extent_ = {1, 1, 1};  // m, of the space that the balls take
  std::vector<Level> levels_;                 // finest first
  std::vector<Bin> groups_;                   // what the levels were chosen for
  std::vector<char> seeks_;                   // by level and other level
  std::uint32_t cells_ = 1;                   // of all levels
  double planned_ = 0;                        // m, half of the longest path at layOut()
  double longest_ = 0;                        // m, half of the longest path of this frame
  double unit_ = 1;                           // m
  double per_unit_ = 1;                       // 1/m
  float margin_ = 0;                          // unit, what single precision may falsify
  SweptLanes lanes_;
  HugePageVector<SweptSphere> first_;        // lanes_ at the start of the frame, by position
  HugePageVector<std::uint32_t> slots_;      // by position
  HugePageVector<std::uint32_t> positions_;  // by slot; while they are filled in, cells
  std::vector<Worker> workers_;
};

// --- templates

template <class Describe>
void SweptGrid::survey(std::size_t count, const Describe& describe, double least) {
  constexpr std::size_t kMostSamples = 64;
  std::array<std::array<double, kMostSamples>, 3> samples{};
  std::size_t sampled = 0;
  for (std::size_t i = 0; i < count; i += count / kMostSamples + 1) {
    const SweptBall ball = describe(i);
    for (std::size_t k = 0; k < 3; ++k) samples[k][sampled] = ball.middle[k];
    ++sampled;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    extent_[k] = std::max(axes_[k].length, least);
    if (axes_[k].kind != SweptAxis::Kind::open || sampled == 0) continue;
    // Where most balls are: a few that have flown off do not make the cells wide.
    std::sort(samples[k].begin(), samples[k].begin() + static_cast<std::ptrdiff_t>(sampled));
    axes_[k].origin = samples[k][sampled / 2];
    const double most = samples[k][sampled - 1 - sampled / 10] - samples[k][sampled / 10];
    extent_[k] = std::max(1.25 * most, least);
  }
}

template <class Describe>
void SweptGrid::layOut(std::size_t count, const Describe& describe) {
  std::array<Bin, kBins> bins{};
  planned_ = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const SweptBall ball = describe(i);
    Bin& bin = bins[static_cast<std::size_t>(binOf(ball.radius))];
    bin.count += 1;
    bin.reach = std::max(bin.reach, ball.radius);
    planned_ = std::max(planned_, ball.half_length);
  }
  for (Bin& bin : bins) bin.reach += 2 * planned_;
  chooseLevels(bins);
}

template <class Describe>
void SweptGrid::fill(std::size_t count, const Describe& describe, WorkerPool& pool) {
  slots_.resize(count);
  positions_.resize(count);
  first_.resize(count);
  lanes_.resize(count);
  countWorkers(pool.size());
  margin_ = 0;
  share(pool, count, [&](std::size_t begin, std::size_t end, unsigned w) {
    Worker& worker = workers_[w];
    worker.ends.assign(std::size_t{cells_} + 1, 0);
    worker.radius.assign(levels_.size(), 0);
    double longest = 0;
    float farthest = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const SweptBall ball = describe(i);
      const SweptSphere sphere = sphereOf(ball);
      const std::size_t level = levelOf(ball.radius);
      worker.radius[level] = std::max(worker.radius[level], ball.radius);
      longest = std::max(longest, ball.half_length);
      farthest = std::max(std::max(farthest, std::abs(sphere.x)),
                          std::max(std::abs(sphere.y), std::abs(sphere.z)));
      lanes_.set(i, sphere);  // by slot, until all have their positions
      const std::uint32_t key = keyOf(levels_[level], sphere);
      positions_[i] = key;
      ++worker.ends[key + 1];
    }
    worker.longest = longest;
    worker.farthest = farthest;
  });
  sumUp();
  share(pool, count, [&](std::size_t begin, std::size_t end, unsigned w) {
    Worker& worker = workers_[w];
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t p = worker.ends[positions_[i] + 1]++;
      positions_[i] = p;
      slots_[p] = static_cast<std::uint32_t>(i);
      SweptSphere sphere = lanes_.at(i);
      sphere.r += margin_;
      first_[p] = sphere;
    }
  });
  share(pool, count, [&](std::size_t begin, std::size_t end, unsigned) {
    for (std::size_t p = begin; p < end; ++p) lanes_.set(p, first_[p]);
  });
}

}  // namespace ball_sim::core
