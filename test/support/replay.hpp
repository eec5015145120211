// Judges a run from its log of impacts alone, without any of the simulator's code.
//
// The balls are moved in long double along their parabolas from impact to impact, and given the
// logged impulses along the logged normals. At each impact the partners have to touch, approach,
// and exchange what the collision law says; between impacts nothing may overlap. Because the
// logged impulses are used, errors add up instead of growing as chaos would have it, and runs of
// any length can be judged.
//
// Assumes what a log can tell: no ball comes to rest on a wall, nothing is changed from outside.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "trial.hpp"

namespace ball_sim::core {
namespace test {

/// The largest deviations seen; all of them rounding in a correct run.
struct ReplayReport {
  long double gap = 0;        ///< of partners at their impact, of the sum of radii (or the radius)
  long double normal = 0;     ///< of logged normals from the true ones
  long double impulse = 0;    ///< of logged impulses from the law, over mass times speed
  long double recession = 0;  ///< speed of partners that part and yet had an impact, m/s
  long double backstep = 0;   ///< of the log's time, s
  long double overlap = 0;    ///< between impacts, of the sum of radii (or the radius)
  long double position = 0;   ///< of the final places, m
  long double velocity = 0;   ///< of the final velocities, m/s

  long double worst() const {
    return std::max({gap, normal, impulse, recession, backstep, overlap, position, velocity});
  }
};

class Replay {
 public:
  explicit Replay(const TestScene& scene)
      : around_(scene.surroundings), gravity_(around_.gravity.cast<long double>()) {
    for (const Ball& ball : scene.balls) {
      const bool fixed = ball.mass == kFixed;
      bodies_.push_back({ball.position.cast<long double>(), ball.velocity.cast<long double>(),
                         fixed ? Vec(Vec::Zero()) : gravity_, ball.radius,
                         fixed ? 0 : 1 / static_cast<long double>(ball.mass)});
    }
    for (int axis = 0; axis < (around_.planar() ? 2 : 3); ++axis) {
      if (around_.periodic) {
        const long double edge =
            static_cast<long double>(around_.box.max[axis]) - around_.box.min[axis];
        edges_[axis] = edge;
        shortest_edge_ = std::min(shortest_edge_, edge);
        continue;
      }
      const Vec unit = Vec::Unit(axis);
      if (std::isfinite(around_.box.min[axis])) {
        walls_.push_back({unit, around_.box.min[axis], boxFace(axis, false)});
      }
      if (std::isfinite(around_.box.max[axis])) {
        walls_.push_back({-unit, -around_.box.max[axis], boxFace(axis, true)});
      }
    }
    for (std::size_t k = 0; k < around_.planes.size(); ++k) {
      const Plane& plane = around_.planes[k];
      walls_.push_back({plane.normal.cast<long double>(), plane.offset, planePartner(k)});
    }
  }

  /// @param log  every impact from time 0 on
  /// @param last  the states at the end
  ReplayReport judge(const std::vector<Collision>& log, const BallStates& last) {
    for (const Collision& collision : log) {
      moveTo(collision.time - Time());
      if (collision.b >= 0) {
        judgePair(collision);
      } else {
        judgeWall(collision);
      }
    }
    moveTo(last.time - Time());
    for (std::size_t i = 0; i < last.ids.size(); ++i) {
      const Body& body = bodies_[last.ids[i]];
      note(report_.position, nearest(last.positions[i].cast<long double>() - body.x).norm());
      note(report_.velocity, (last.velocities[i].cast<long double>() - body.v).norm());
    }
    return report_;
  }

 private:
  using Vec = VectorOf<long double>;
  struct Body {
    Vec x, v, a;             // m, m/s, m/s^2
    long double radius = 0;  // m
    long double w = 0;       // 1/kg
  };
  struct HalfSpace {
    Vec normal;
    long double offset;  // m
    Partner partner;
  };

  static void note(long double& worst, long double value) { worst = std::max(worst, value); }

  Vec nearest(Vec dx) const {
    for (int axis = 0; axis < 3; ++axis) {
      if (edges_[axis] > 0) dx[axis] -= edges_[axis] * std::round(dx[axis] / edges_[axis]);
    }
    return dx;
  }

  // Calls f with the nearest image of dx and those around it.
  template <class Function>
  void forImages(const Vec& dx, Function f) const {
    const Vec middle = nearest(dx);
    const auto span = [&](int axis) { return edges_[axis] > 0 ? 1 : 0; };
    for (int i = -span(0); i <= span(0); ++i) {
      for (int j = -span(1); j <= span(1); ++j) {
        for (int k = -span(2); k <= span(2); ++k) {
          f(Vec(middle + Vec(i * edges_[0], j * edges_[1], k * edges_[2])));
        }
      }
    }
  }

  void moveTo(long double date) {
    note(report_.backstep, now_ - date);
    while (now_ < date) {
      long double step = date - now_;
      if (around_.periodic) {  // so short that no image beyond the looked-at ones comes near
        for (const Body& body : bodies_) {
          const long double speed = body.v.norm() + std::sqrt(body.a.norm() * shortest_edge_);
          if (speed > 0) step = std::min(step, shortest_edge_ / (8 * speed));
        }
      }
      judgeFlight(step);
      for (Body& body : bodies_) {
        body.x += step * (body.v + step / 2 * body.a);
        body.v += step * body.a;
      }
      now_ = step < date - now_ ? now_ + step : date;
    }
  }

  // The deepest overlap of any two balls during the coming `step`.
  void judgeFlight(long double step) {
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const Body& a = bodies_[i];
      for (const HalfSpace& wall : walls_) {
        if (a.w == 0) continue;
        const Vec end = a.x + step * (a.v + step / 2 * a.a);
        note(report_.overlap, 1 - (dot(wall.normal, end) - wall.offset) / a.radius);
      }
      for (std::size_t j = i + 1; j < bodies_.size(); ++j) {
        const Body& b = bodies_[j];
        if (a.w == 0 && b.w == 0) continue;
        const Vec dv = b.v - a.v;
        const Vec da = b.a - a.a;
        const long double reach = a.radius + b.radius;
        forImages(b.x - a.x, [&](const Vec& dx) {
          const auto judgeAt = [&](long double t) {
            const Vec d = dx + t * (dv + t / 2 * da);
            note(report_.overlap, 1 - d.norm() / reach);
          };
          if (dot(da, da) == 0) {  // straight: nearest at one known moment
            const long double speed2 = dot(dv, dv);
            if (speed2 > 0) judgeAt(std::clamp(-dot(dx, dv) / speed2, 0.0L, step));
          } else {
            for (int k = 1; k <= 8; ++k) judgeAt(step * k / 8);
          }
        });
      }
    }
  }

  void judgePair(const Collision& collision) {
    Body& a = bodies_[collision.a];
    Body& b = bodies_[static_cast<std::size_t>(collision.b)];
    const Vec n = collision.normal.cast<long double>();
    const long double reach = a.radius + b.radius;
    Vec contact = Vec::Zero();  // the image that lies where the normal says
    long double best = -1;
    forImages(b.x - a.x, [&](const Vec& dx) {
      const long double miss = (dx - reach * n).norm();
      if (best < 0 || miss < best) {
        best = miss;
        contact = dx;
      }
    });
    note(report_.gap, std::abs(contact.norm() / reach - 1));
    note(report_.normal, (contact / contact.norm() - n).norm());
    const long double u = dot(a.v, n) - dot(b.v, n);
    note(report_.recession, -u);
    judgeImpulse(collision, u, a.w + b.w, a.v.norm() + b.v.norm());
    a.v -= collision.impulse * a.w * n;
    b.v += collision.impulse * b.w * n;
  }

  void judgeWall(const Collision& collision) {
    Body& body = bodies_[collision.a];
    const Vec n = collision.normal.cast<long double>();
    for (const HalfSpace& wall : walls_) {
      if (wall.partner != collision.b) continue;
      const long double distance = dot(wall.normal, body.x) - wall.offset;
      note(report_.gap, std::abs(distance / body.radius - 1));
      note(report_.normal, (wall.normal + n).norm());
    }
    const long double u = dot(body.v, n);
    note(report_.recession, -u);
    judgeImpulse(collision, u, body.w, body.v.norm());
    body.v -= collision.impulse * body.w * n;
  }

  void judgeImpulse(const Collision& collision, long double u, long double w, long double speed) {
    const long double wanted = (1 + static_cast<long double>(around_.restitution)) * u / w;
    note(report_.impulse, std::abs(collision.impulse - wanted) * w / speed);
    note(report_.impulse, std::abs(collision.approach_speed - u) / speed);
  }

  Surroundings around_;
  Vec gravity_;
  std::vector<Body> bodies_;
  std::vector<HalfSpace> walls_;
  Vec edges_ = Vec::Zero();  // m, of a periodic box; 0: does not wrap
  long double shortest_edge_ = std::numeric_limits<long double>::infinity();
  long double now_ = 0;  // s
  ReplayReport report_;
};

}  // namespace test
}  // namespace ball_sim::core
