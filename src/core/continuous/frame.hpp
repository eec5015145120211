// A frame of method continuous: from when to when it goes, and a grid of all paths within it.
//
// A frame is as long as makes the least work (frame_length.hpp). At its start all balls are put
// into the grid (swept_grid.hpp) by the middle of their paths; until it ends the grid is told of
// every path that changes, or that would change if a plan came true. One that leads too far for the
// grid ends the frame. Now and then the frame gives the balls new slots, in the order of space.
//
// Frames decide when an impact is computed, and no bit of it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "ball_sim/surroundings.hpp"
#include "ball_sim/time.hpp"
#include "continuous/balls.hpp"
#include "continuous/frame_length.hpp"
#include "continuous/swept_grid.hpp"
#include "continuous/worker_pool.hpp"

namespace ball_sim::core::continuous {

/// When a frame begins, and what has happened until then.
template <class Real>
struct FrameStart {
  Real now;                ///< s, in this era
  Real limit;              ///< s, in this era: as far as anybody looks, if nothing moves
  Real era;                ///< s, length of this era
  Time origin;             ///< when this era began
  std::uint64_t searches;  ///< after impacts, one a ball
};

template <class Real, bool kGravity>
class Frame {
  using Vec = VectorOf<Real>;

 public:
  /// @param balls  outlive the frame, which gives them other slots
  Frame(const Surroundings& surroundings, Balls<Real, kGravity>& balls)
      : balls_(balls), planar_(surroundings.planar()), grid_(axesOf(surroundings)) {}

  bool isOpen() const { return open_; }
  Real start() const { return start_; }  ///< s, in this era
  Real end() const { return end_; }      ///< s, in this era

  /// Begins a frame.
  void open(const FrameStart<Real>& from, WorkerPool& pool) {
    if (++layout_age_ > kFramesPerLayout) layOut(from);
    fillGrid(from, pool);
    if (grid_.hasOutgrownItsCells()) {
      layOut(from);
      fillGrid(from, pool);
    }
    if (++frames_since_renumbering_ >= kFramesPerRenumbering) renumber(pool);
    open_ = true;
  }

  void close() { open_ = false; }

  /// The next frame looks anew how long frames and how large cells should be.
  void forgetLayout() { layout_age_ = kFramesPerLayout; }

  // --- paths in the grid

  const SweptGrid& grid() const { return grid_; }

  /// Whether a ball may meet one image of another at most.
  bool oneImageIsNear() const { return one_image_is_near_; }

  /// A ball's path from its last change in this frame to the end of the frame, in the image that
  /// the grid has taken the ball to until now.
  SweptBall inGrid(const Path<Real>& path) const {
    SweptBall ball = swept(path);
    if (balls_.box.repeats()) {
      const std::array<int, 3> turns = turnsInGrid(ball, grid_.positions()[path.slot]);
      for (std::size_t k = 0; k < 3; ++k) {
        ball.middle[k] += turns[k] * double(balls_.box.period(k));
      }
    }
    return ball;
  }

  /// The grid has found b, from a, in some image: which one is it of the places stored?
  /// @param seen  periods from where the grid has b to the image that was found
  Turns turnsBetween(const Path<Real>& a, const Path<Real>& b, const Turns& seen) const {
    const std::array<int, 3> own = turnsInGrid(a);
    const std::array<int, 3> others = turnsInGrid(b);
    Turns turns{};
    for (std::size_t k = 0; k < 3; ++k) {
      turns[k] = static_cast<std::int16_t>(seen[k] + others[k] - own[k]);
    }
    return turns;
  }

  /// Takes a ball's new path into the grid, or ends the frame if it leads too far.
  /// @return the path in the grid
  SweptBall change(Slot slot) {
    const SweptBall rest = inGrid(balls_.pathOf(slot));
    if (open_ && !grid_.change(grid_.positions()[slot], rest)) open_ = false;
    return rest;
  }

  /// Lets the grid show a path that a ball may take, beside the one that it has. Threads may do so
  /// for different balls.
  /// @return false when it leads too far
  bool add(const Path<Real>& path) { return grid_.add(grid_.positions()[path.slot], inGrid(path)); }

  /// Fetches from memory what an impact of a ball will need: the ball, and afterwards its path in
  /// the grid.
  void fetchBall(Slot slot) const {
    balls_.fetch(slot);
    touch(&grid_.positions()[slot]);
  }
  void fetchPath(Slot slot) const { grid_.fetch(grid_.positions()[slot]); }

  std::size_t bytes() const { return grid_.bytes(); }

 private:
  static constexpr std::uint32_t kFramesPerLayout = 64;
  static constexpr std::uint32_t kFramesPerRenumbering = 8;

  static std::array<SweptAxis, 3> axesOf(const Surroundings& surroundings) {
    std::array<SweptAxis, 3> axes;
    for (int k = 0; k < 3; ++k) {
      SweptAxis& axis = axes[static_cast<std::size_t>(k)];
      const double low = surroundings.box.min[k], high = surroundings.box.max[k];
      axis.kind = SweptAxis::Kind::flat;
      if (k == 2 && surroundings.planar()) continue;
      axis.kind = SweptAxis::Kind::open;
      if (!std::isfinite(low) || !std::isfinite(high)) continue;
      axis.kind = surroundings.periodic ? SweptAxis::Kind::periodic : SweptAxis::Kind::closed;
      axis.origin = low;
      axis.length = high - low;
    }
    return axes;
  }

  // Puts all balls into the grid, for one of so many frames of one length as it takes to the end of
  // the era.
  void fillGrid(const FrameStart<Real>& from, WorkerPool& pool) {
    start_ = from.now;
    const Real left = from.era - from.now;
    const Real frames = std::ceil(left / length_ - Real(0.25));
    end_ = frames > 1 ? from.now + left / frames : from.era;
    if (!(end_ < kNever<Real>)) end_ = std::max(from.now, from.limit);
    grid_.fill(balls_.size(), atHome(), pool);
    // Two paths that meet lie within four reaches, and a nearest image is nearer than half a
    // period.
    const Real near = Real(8 * grid_.reach());
    one_image_is_near_ = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const Real period = balls_.box.period(k);
      if (period > 0 && !(near < period)) one_image_is_near_ = false;
    }
  }

  // Looks at how the balls are, to choose frames and cells for them.
  void layOut(const FrameStart<Real>& from) {
    FrameSurvey survey = takeSurvey(from);
    start_ = end_ = from.now;
    grid_.survey(balls_.size(), atHome(), survey.leastExtent());
    survey.volume = grid_.volume();
    length_ = std::max(Real(frameLength(survey)), Real(0x1p-44) * from.era);
    if (from.era < kNever<Real>) end_ = std::min(from.now + length_, from.now + from.era);
    grid_.layOut(balls_.size(), atHome());
    layout_age_ = 0;
  }

  // Counts searches from one call to the next.
  FrameSurvey takeSurvey(const FrameStart<Real>& from) {
    FrameSurvey survey;
    survey.planar = planar_;
    for (Slot slot = 0; slot < balls_.size(); ++slot) {
      const Vec v = balls_.velocityAt(slot, from.now);
      using std::sqrt;
      survey.add(double(balls_.bodies[slot].radius), double(sqrt(dot(v, v))));
    }
    const std::uint64_t searches = from.searches - searches_at_layout_;
    const double elapsed = double(from.now - layout_time_) + (from.origin - layout_origin_);
    if (searches > 0 && elapsed > 0) survey.search_rate = double(searches) / elapsed;
    searches_at_layout_ = from.searches;
    layout_time_ = from.now;
    layout_origin_ = from.origin;
    return survey;
  }

  // Gives the balls new slots in the grid's order, so that neighbours in space are neighbours in
  // memory.
  void renumber(WorkerPool& pool) {
    frames_since_renumbering_ = 0;
    balls_.moveTo(grid_.positions(), pool);
    grid_.renumber();
  }

  // A ball's path from its last change in this frame to the end of the frame.
  SweptBall swept(const Path<Real>& path) const {
    using std::sqrt;
    const Real begin = std::max(path.body->time, start_);
    const Real length = std::max(end_ - begin, Real(0));
    const Vec x = balls_.positionAt(path, begin);
    Vec half = (length / 2) * balls_.velocityAt(path, begin);
    SweptBall ball;
    ball.radius = double(path.body->radius);
    if constexpr (kGravity) {
      const Vec& a = balls_.accelerations[path.slot];
      half += (length * length / 4) * a;
      ball.radius += double(length * length / 8 * sqrt(dot(a, a)));  // the bulge of the parabola
    }
    const Vec middle = x + half;
    for (std::size_t k = 0; k < 3; ++k) {
      ball.middle[k] = double(middle[static_cast<int>(k)]);
      ball.half[k] = double(half[static_cast<int>(k)]);
    }
    ball.half_length = double(sqrt(dot(half, half)));
    return ball;
  }

  // The same by slot, with its middle in the periodic box.
  auto atHome() const {
    return [this](std::size_t slot) {
      SweptBall ball = swept(balls_.pathOf(static_cast<Slot>(slot)));
      if (balls_.box.repeats()) {
        const Vec middle(Real(ball.middle[0]), Real(ball.middle[1]), Real(ball.middle[2]));
        const Vec home = balls_.box.wrapped(middle);
        for (std::size_t k = 0; k < 3; ++k) ball.middle[k] = double(home[static_cast<int>(k)]);
      }
      return ball;
    };
  }

  // So many periods lies the image that the grid has of a ball from the one that its body tells.
  std::array<int, 3> turnsInGrid(const Path<Real>& path) const {
    return turnsInGrid(swept(path), grid_.positions()[path.slot]);
  }
  std::array<int, 3> turnsInGrid(const SweptBall& ball, std::size_t position) const {
    std::array<int, 3> turns = {0, 0, 0};
    const std::array<double, 3> middle = grid_.middleAt(position);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto period = double(balls_.box.period(k));
      if (period > 0) {
        turns[k] = static_cast<int>(std::floor((middle[k] - ball.middle[k]) / period + 0.5));
      }
    }
    return turns;
  }

  Balls<Real, kGravity>& balls_;
  bool planar_;
  bool open_ = false;
  Real start_ = 0;  // s, in this era
  Real end_ = 0;    // s, in this era
  SweptGrid grid_;
  bool one_image_is_near_ = true;  // of any ball to another that it may meet

  // How frames and cells were chosen.
  Real length_ = 0;                              // s
  std::uint32_t layout_age_ = kFramesPerLayout;  // frames
  std::uint32_t frames_since_renumbering_ = kFramesPerRenumbering;
  std::uint64_t searches_at_layout_ = 0;
  Real layout_time_ = 0;  // s, in the era that began at layout_origin_
  Time layout_origin_;
};

}  // namespace ball_sim::core::continuous
