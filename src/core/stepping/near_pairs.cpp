// Broad phase of the stepping methods.
#include "stepping/near_pairs.hpp"

#include <algorithm>
#include <cmath>

#include "ball_sim/ball_check.hpp"
#include "capacity_bytes.hpp"

namespace ball_sim::core {
namespace {

constexpr double kStepsPerList = 10;  // the skin is wide enough for so many
constexpr double kWidestSkin = 0.4;   // of the largest radius; wider ones list too many pairs
constexpr std::uint32_t kHome = 13;   // the image that is not shifted
constexpr double kCellsPerBall = 4;   // at most; emptier grids only cost memory

}  // namespace

NearPairs::NearPairs(const Surroundings& surroundings)
    : surroundings_(surroundings), walls_(wallsOf<double>(surroundings)) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!surroundings.periodic || (axis == 2 && surroundings.planar())) continue;
    period_[axis] = surroundings.box.max[axis] - surroundings.box.min[axis];
  }
  for (int image = 0; image < 27; ++image) {
    const Vector3 digits(image % 3, image / 3 % 3, image / 9);
    shifts_[static_cast<std::size_t>(image)] = (digits - Vector3::Ones()).cwiseProduct(period_);
  }
}

std::uint32_t NearPairs::nearestImage(const Vector3& between) const {
  std::uint32_t image = 0;
  std::uint32_t digit = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double half = period_[axis] / 2;
    const bool beyond = half > 0 && between[axis] >= half;
    const bool before = half > 0 && between[axis] < -half;
    image += digit * (beyond ? 0u : before ? 2u : 1u);
    digit *= 3;
  }
  return image;
}

void NearPairs::list(std::vector<SteppedBall>& balls, const std::vector<Slot>& movers,
                     const std::vector<Slot>& still, double distance, double margin) {
  double largest = 0;
  for (const Slot slot : movers) largest = std::max(largest, balls[slot].radius);
  for (const Slot slot : still) largest = std::max(largest, balls[slot].radius);
  skin_ = std::min(2 * kStepsPerList * distance, kWidestSkin * largest);
  if (skin_ < 4 * distance) skin_ = 0;  // a list for one step alone needs none
  moved_ = 0;

  if (surroundings_.periodic) {
    for (const Slot slot : movers) balls[slot].x = wrapped(balls[slot].x, surroundings_);
  }
  keepTouching();
  cut(balls, movers, still, 2 * largest + margin + skin_);
  fill(balls, movers, still);
  pairs_.clear();
  for (const Slot slot : movers) {
    first_[slot] = static_cast<std::uint32_t>(pairs_.size());
    findPairsOf(balls, slot, margin);
    findWallsOf(balls[slot], slot, margin);
    behind_[slot] = static_cast<std::uint32_t>(pairs_.size());
  }
  recall();
}

// Chooses the cells along each axis: from wall to wall where there are walls, around the box where
// it is periodic; on an open axis a cell's index is taken modulo their number, so that balls which
// share a cell by chance only cost a look.
void NearPairs::cut(const std::vector<SteppedBall>& balls, const std::vector<Slot>& movers,
                    const std::vector<Slot>& still, double width) {
  const int dimension = surroundings_.planar() ? 2 : 3;
  const double most = kCellsPerBall * static_cast<double>(movers.size() + still.size()) + 64;
  std::array<double, 3> cells = {1, 1, 1};
  std::array<double, 3> length{};
  for (int k = 0; k < dimension && width > 0; ++k) {
    const auto i = static_cast<std::size_t>(k);
    length[i] = surroundings_.box.max[k] - surroundings_.box.min[k];
    cells[i] = std::isfinite(length[i]) ? std::floor(length[i] / width)
                                        : std::ceil(std::pow(most, 1.0 / dimension));
    cells[i] = std::clamp(cells[i], 1.0, most);
  }
  while (cells[0] * cells[1] * cells[2] > most) {
    auto& widest = *std::max_element(cells.begin(), cells.end());
    widest = std::max(1.0, std::floor(widest / 1.25));
  }
  for (std::size_t k = 0; k < 3; ++k) {
    Axis& axis = axes_[k];
    axis.cells = static_cast<std::uint32_t>(cells[k]);
    if (axis.cells == 1) continue;
    const bool bounded = std::isfinite(length[k]);
    axis.origin = bounded ? surroundings_.box.min[static_cast<int>(k)] : 0;
    axis.per_width = bounded ? cells[k] / length[k] : 1 / width;
    axis.wraps = surroundings_.periodic || !bounded;
  }
  first_.resize(balls.size());
  behind_.resize(balls.size());
  moves_.assign(balls.size(), 0);
  for (const Slot slot : movers) moves_[slot] = 1;
}

std::uint32_t NearPairs::cellAlong(std::size_t k, double x) const {
  const Axis& axis = axes_[k];
  if (axis.cells == 1) return 0;
  const auto cells = static_cast<double>(axis.cells);
  double cell = std::floor((x - axis.origin) * axis.per_width);
  if (axis.wraps) cell -= std::floor(cell / cells) * cells;
  return static_cast<std::uint32_t>(std::clamp(cell, 0.0, cells - 1));
}

// Sorts the balls by cell, by counting.
void NearPairs::fill(const std::vector<SteppedBall>& balls, const std::vector<Slot>& movers,
                     const std::vector<Slot>& still) {
  const std::size_t count = std::size_t{axes_[0].cells} * axes_[1].cells * axes_[2].cells;
  cell_begin_.assign(count + 1, 0);
  cells_.resize(balls.size());
  members_.resize(movers.size() + still.size());
  const auto index = [this](const std::array<std::uint32_t, 3>& c) {
    return (std::size_t{c[2]} * axes_[1].cells + c[1]) * axes_[0].cells + c[0];
  };
  const auto forAll = [&](auto visit) {
    for (const Slot slot : movers) visit(slot);
    for (const Slot slot : still) visit(slot);
  };
  forAll([&](Slot slot) {
    const Vector3& x = balls[slot].x;
    cells_[slot] = {cellAlong(0, x[0]), cellAlong(1, x[1]), cellAlong(2, x[2])};
    ++cell_begin_[index(cells_[slot])];
  });
  std::uint32_t sum = 0;
  for (std::uint32_t& begin : cell_begin_) sum = begin += sum;
  forAll([&](Slot slot) { members_[--cell_begin_[index(cells_[slot])]] = slot; });
}

// A cell and its neighbours along one axis, each once however few cells there are.
NearPairs::AxisCells NearPairs::around(std::size_t k, std::uint32_t cell) const {
  const Axis& axis = axes_[k];
  AxisCells found;
  const auto add = [&](std::uint32_t c) {
    for (std::uint32_t i = 0; i < found.count; ++i) {
      if (found.cell[i] == c) return;
    }
    found.cell[found.count++] = c;
  };
  add(cell);
  if (cell > 0) add(cell - 1);
  if (cell + 1 < axis.cells) add(cell + 1);
  if (axis.wraps && cell == 0) add(axis.cells - 1);
  if (axis.wraps && cell + 1 == axis.cells) add(0);
  return found;
}

void NearPairs::findPairsOf(const std::vector<SteppedBall>& balls, Slot mover, double margin) {
  const SteppedBall& ball = balls[mover];
  const auto& at = cells_[mover];
  const AxisCells along_x = around(0, at[0]);
  const AxisCells along_y = around(1, at[1]);
  const AxisCells along_z = around(2, at[2]);
  const double room = ball.radius + margin + skin_;
  const auto consider = [&](Slot other) {
    if (other == mover || (moves_[other] != 0 && other < mover)) return;
    Vector3 dx = balls[other].x - ball.x;
    std::uint32_t image = kHome;
    if (surroundings_.periodic) {
      image = nearestImage(dx);
      dx += shifts_[image];
    }
    const double reach = room + balls[other].radius;
    if (dot(dx, dx) < reach * reach) pairs_.push_back({mover, other, image, false, 0, 0});
  };
  for (std::uint32_t k = 0; k < along_z.count; ++k) {
    for (std::uint32_t j = 0; j < along_y.count; ++j) {
      const std::size_t row =
          (std::size_t{along_z.cell[k]} * axes_[1].cells + along_y.cell[j]) * axes_[0].cells;
      for (std::uint32_t i = 0; i < along_x.count; ++i) {
        const std::size_t cell = row + along_x.cell[i];
        for (std::uint32_t m = cell_begin_[cell]; m < cell_begin_[cell + 1]; ++m) {
          consider(members_[m]);
        }
      }
    }
  }
}

void NearPairs::findWallsOf(const SteppedBall& ball, Slot mover, double margin) {
  for (std::size_t k = 0; k < walls_.size(); ++k) {
    const double gap = dot(ball.x, walls_[k].normal) - walls_[k].offset - ball.radius;
    if (gap >= margin + skin_) continue;
    pairs_.push_back({mover, kFirstWall + static_cast<std::uint32_t>(k), kHome, false, 0, 0});
  }
}

void NearPairs::keepTouching() {
  touching_.swap(dormant_);
  dormant_.clear();
  for (const NearPair& pair : pairs_) {
    if (pair.touching) touching_.push_back(pair);
  }
}

// Gives pairs that touched what was remembered of them; a pair is listed under either ball. What is
// between balls that stand still is left for when one of them moves.
void NearPairs::recall() {
  const auto moves = [this](std::uint32_t b) { return b < moves_.size() && moves_[b] != 0; };
  const auto recallUnder = [&](Slot slot, std::uint32_t partner, const NearPair& old) {
    for (std::uint32_t i = first_[slot]; i < behind_[slot]; ++i) {
      if (pairs_[i].b != partner) continue;
      pairs_[i].touching = true;
      pairs_[i].impulse = old.impulse;
      pairs_[i].reference = old.reference;
      return true;
    }
    return false;
  };
  for (const NearPair& old : touching_) {
    const bool a_moves = moves(old.a);
    const bool b_moves = moves(old.b);
    if (!a_moves && !b_moves) {
      dormant_.push_back(old);
    } else if (!(a_moves && recallUnder(old.a, old.b, old)) && b_moves) {
      recallUnder(old.b, old.a, old);
    }
  }
}

std::size_t NearPairs::bytes() const {
  return capacityBytes(pairs_) + capacityBytes(touching_) + capacityBytes(dormant_) +
         capacityBytes(first_) + capacityBytes(behind_) + capacityBytes(moves_) +
         capacityBytes(cell_begin_) + capacityBytes(members_) + capacityBytes(cells_);
}

}  // namespace ball_sim::core
