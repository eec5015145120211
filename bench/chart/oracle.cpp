// The motion of many balls in 256-bit arithmetic.
#include "oracle.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <queue>
#include <stdexcept>

#include "multiprecision.hpp"

namespace ball_sim::core::chart {
namespace {

using Real = Multiprecision;
using Vec = VectorOf<Real>;

// A slice's pairs may be so much further apart than they reach, of the largest reach.
constexpr double kMargin = 0.3;
// Speeds may grow by so much before the pairs are looked up anew.
constexpr double kHeadroom = 1.3;

class Oracle {
 public:
  explicit Oracle(const PreparedScene& scene)
      : surroundings_(scene.surroundings), trajectory_(scene.balls, Vector3::Zero()) {
    for (const Ball& ball : scene.balls) {
      bodies_.push_back({ball.position.cast<Real>(),
                         ball.velocity.cast<Real>(),
                         ball.radius,
                         Real(ball.mass),
                         0,
                         {}});
      largest_radius_ = std::max(largest_radius_, ball.radius);
    }
    check(scene);
  }

  Trajectory run(double until) {
    while (now_ < until) {
      startSlice(until);
      while (!heap_.empty()) {
        const Meeting next = heap_.top();
        heap_.pop();
        if (!isStale(next)) resolve(next);
        if (too_fast_) break;
      }
      if (!too_fast_) now_ = slice_end_;
    }
    return std::move(trajectory_);
  }

 private:
  struct Neighbour {
    std::size_t index;
    Vec shift;  // of its image, m
  };

  struct Body {
    Vec origin;  // m, where its line is at date 0
    Vec v;       // m/s
    double radius;
    Real mass;
    unsigned changes;  // of its velocity
    std::vector<Neighbour> neighbours;
  };

  // Of ball a with ball b, or with the face of its box that is b.
  struct Meeting {
    Real date;
    std::size_t a = 0;
    Partner b = 0;
    Vec shift = Vec::Zero();
    unsigned changes_a = 0;
    unsigned changes_b = 0;

    bool operator<(const Meeting& o) const { return o.date < date; }  // the earliest on top
  };

  void check(const PreparedScene& scene) const {
    const auto demand = [](bool holds, const char* what) {
      if (!holds) throw std::invalid_argument(std::string("the oracle needs ") + what);
    };
    demand(surroundings_.gravity == Vector3::Zero(), "scenes without gravity");
    demand(surroundings_.restitution == 1, "a restitution of 1");
    demand(surroundings_.planes.empty(), "walls that are faces of the box");
    for (const Ball& ball : scene.balls) demand(std::isfinite(ball.mass), "balls that can move");
    for (int axis = 0; axis < periodicAxes(); ++axis) {
      demand(edge(axis) > 3 * 2 * largest_radius_, "a larger periodic box");
    }
  }

  int periodicAxes() const { return surroundings_.periodic ? (surroundings_.planar() ? 2 : 3) : 0; }
  double edge(int axis) const { return surroundings_.box.max[axis] - surroundings_.box.min[axis]; }
  Real exactEdge(int axis) const {
    return Real(surroundings_.box.max[axis]) - Real(surroundings_.box.min[axis]);
  }

  static Real scalar(const Vec& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

  Vec placeOf(const Body& body) const { return body.origin + now_ * body.v; }

  // --- slices

  void startSlice(double until) {
    const double margin = kMargin * 2 * largest_radius_;
    Real fastest = 0;
    for (const Body& body : bodies_) fastest = std::max(fastest, scalar(body.v, body.v));
    speed_limit_ = kHeadroom * sqrt(fastest);
    slice_end_ = std::min(Real(until), Real(now_ + margin / (2 * speed_limit_)));
    too_fast_ = false;
    findNeighbours(margin);
    heap_ = {};
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      foreseeWalls(i);
      for (const Neighbour& other : bodies_[i].neighbours) {
        if (other.index > i) foreseePair(i, other);
      }
    }
  }

  // Pairs that are near each other, by a sweep along x. Doubles tell that well enough: the margin
  // is taken a little wider.
  void findNeighbours(double margin) {
    std::vector<Vector3> places;
    for (Body& body : bodies_) {
      body.neighbours.clear();
      places.push_back(placeOf(body).cast<double>());
    }
    if (surroundings_.periodic) {
      for (std::size_t i = 0; i < places.size(); ++i) wrap(places[i], bodies_[i]);
    }
    std::vector<std::size_t> order(places.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return places[a].x() < places[b].x(); });
    const double widest = 2 * largest_radius_ + margin;
    for (std::size_t k = 0; k < order.size(); ++k) {
      for (std::size_t step = 1; step < order.size(); ++step) {
        const std::size_t place = (k + step) % order.size();
        const bool around = k + step >= order.size();
        if (around && !surroundings_.periodic) break;
        const double shift = around ? edge(0) : 0;
        if (places[order[place]].x() + shift - places[order[k]].x() > 1.001 * widest) break;
        considerNeighbours(order[k], order[place], places, around, margin);
      }
    }
  }

  // Brings a ball into the box, its line with it.
  void wrap(Vector3& place, Body& body) const {
    for (int axis = 0; axis < periodicAxes(); ++axis) {
      const double images = std::floor((place[axis] - surroundings_.box.min[axis]) / edge(axis));
      place[axis] -= images * edge(axis);
      body.origin[axis] -= images * exactEdge(axis);
    }
  }

  // `around`: b's image beyond the upper face in x is meant.
  void considerNeighbours(std::size_t a, std::size_t b, const std::vector<Vector3>& places,
                          bool around, double margin) {
    Vector3 dx = places[b] - places[a];
    Vector3 images = Vector3::Zero();
    for (int axis = 0; axis < periodicAxes(); ++axis) {
      images[axis] = axis == 0 ? (around ? 1 : 0) : -std::round(dx[axis] / edge(axis));
      dx[axis] += images[axis] * edge(axis);
    }
    if (dx.norm() > 1.001 * (bodies_[a].radius + bodies_[b].radius + margin)) return;
    Vec shift = Vec::Zero();
    for (int axis = 0; axis < periodicAxes(); ++axis) shift[axis] = images[axis] * exactEdge(axis);
    bodies_[a].neighbours.push_back({b, shift});
    bodies_[b].neighbours.push_back({a, -shift});
  }

  // --- meetings

  bool isStale(const Meeting& meeting) const {
    if (bodies_[meeting.a].changes != meeting.changes_a) return true;
    return meeting.b >= 0 &&
           bodies_[static_cast<std::size_t>(meeting.b)].changes != meeting.changes_b;
  }

  void foresee(std::size_t index) {
    foreseeWalls(index);
    for (const Neighbour& other : bodies_[index].neighbours) foreseePair(index, other);
  }

  void foreseeWalls(std::size_t index) {
    if (surroundings_.periodic) return;
    const Body& body = bodies_[index];
    for (int axis = 0; axis < (surroundings_.planar() ? 2 : 3); ++axis) {
      if (body.v[axis] == 0) continue;
      const bool upper = body.v[axis] > 0;
      const double face = upper ? surroundings_.box.max[axis] : surroundings_.box.min[axis];
      if (!std::isfinite(face)) continue;
      const Real place = upper ? Real(face) - Real(body.radius) : Real(face) + Real(body.radius);
      const Real date = (place - body.origin[axis]) / body.v[axis];
      add({std::max(date, now_), index, boxFace(axis, upper), Vec::Zero(), body.changes, 0});
    }
  }

  void foreseePair(std::size_t index, const Neighbour& other) {
    const Body& a = bodies_[index];
    const Body& b = bodies_[other.index];
    const std::optional<Real> date = dateOfPair(a, b, other.shift);
    if (!date) return;
    add({*date, index, static_cast<Partner>(other.index), other.shift, a.changes, b.changes});
  }

  // The earlier root of |dx + (t - now) dv| = reach, of those that approach; those that overlap
  // meet now.
  std::optional<Real> dateOfPair(const Body& a, const Body& b, const Vec& shift) const {
    const Vec dx = placeOf(b) + shift - placeOf(a);
    const Vec dv = b.v - a.v;
    const Real approach = -scalar(dx, dv);
    if (approach <= 0) return std::nullopt;
    const Real reach = Real(a.radius) + Real(b.radius);
    const Real outside = scalar(dx, dx) - reach * reach;
    if (outside <= 0) return now_;
    const Real speed = scalar(dv, dv);
    const Real discriminant = approach * approach - speed * outside;
    if (discriminant <= 0) return std::nullopt;
    return Real(now_ + (approach - sqrt(discriminant)) / speed);
  }

  void add(const Meeting& meeting) {
    if (meeting.date <= slice_end_) heap_.push(meeting);
  }

  void resolve(const Meeting& meeting) {
    now_ = meeting.date;
    if (meeting.b < 0) {
      Vec v = bodies_[meeting.a].v;
      const auto axis = static_cast<Eigen::Index>((-1 - meeting.b) / 2);
      v[axis] = -v[axis];
      turn(meeting.a, v);
    } else {
      resolvePair(meeting);
    }
    trajectory_.addImpact(now_.convert_to<double>(),
                          impactOf(static_cast<BallId>(meeting.a), meeting.b));
    foresee(meeting.a);
    if (meeting.b >= 0) foresee(static_cast<std::size_t>(meeting.b));
  }

  void resolvePair(const Meeting& meeting) {
    const auto other = static_cast<std::size_t>(meeting.b);
    const Body& a = bodies_[meeting.a];
    const Body& b = bodies_[other];
    const Vec dx = placeOf(b) + meeting.shift - placeOf(a);
    const Vec normal = dx / sqrt(scalar(dx, dx));
    const Real impulse = 2 * scalar(a.v - b.v, normal) / (1 / a.mass + 1 / b.mass);
    const Vec v_a = a.v - (impulse / a.mass) * normal;
    const Vec v_b = b.v + (impulse / b.mass) * normal;
    turn(meeting.a, v_a);
    turn(other, v_b);
  }

  // From now on the ball flies at v.
  void turn(std::size_t index, const Vec& v) {
    Body& body = bodies_[index];
    const Vec place = placeOf(body);
    body.v = v;
    body.origin = place - now_ * v;
    ++body.changes;
    if (scalar(v, v) > speed_limit_ * speed_limit_) too_fast_ = true;
    trajectory_.add(static_cast<BallId>(index), now_.convert_to<double>(),
                    {place.cast<double>(), v.cast<double>()});
  }

  Surroundings surroundings_;
  Trajectory trajectory_;
  std::vector<Body> bodies_;
  std::priority_queue<Meeting> heap_;
  double largest_radius_ = 0;  // m
  Real now_ = 0;               // s
  Real slice_end_ = 0;         // s
  Real speed_limit_ = 0;       // m/s, up to which the slice's pairs are all there are
  bool too_fast_ = false;      // a ball is beyond it
};

}  // namespace

Trajectory oracleTrajectory(const PreparedScene& scene, double until) {
  return Oracle(scene).run(until);
}

}  // namespace ball_sim::core::chart
