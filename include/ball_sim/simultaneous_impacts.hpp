// Impacts at one instant that share balls: which they are, whether their order matters, and the
// policy `simultaneous`, which takes them all at once.
//
// Two contacts at one instant that share ball c, with unit normals nA, nB from c, meet in the space
// of mass-weighted velocities at an angle theta,
//   cos(theta) = -(nA.nB) w_c / sqrt((w_c + w_A)(w_c + w_B)),   w = 1/mass.
// Only where theta is pi/k for a whole k (and, if restitution takes energy, only for k = 2) is the
// outcome the same in whichever order the pairs are resolved. Elsewhere hard balls do not say what
// happens, and a policy has to. `sequential` takes the pairs one after the other, `simultaneous`
// by generalized reflections (Smith, Kaufman, Vouga, Tamstorf, Grinspun, "Reflections on
// Simultaneous Impact", 2012): of all contacts of a cluster of touching balls those that approach
// are reflected at once, and then again, until none approaches. With A = J W J^T, J the rows that
// take velocities to speeds of approach u, W the reciprocal masses, the impulses are the l that
// satisfy
//   l >= 0,   A l >= (1 + e) u,   l.(A l - (1 + e) u) = 0.
// The change of velocity is unique, so that the outcome does not depend on the order of the balls,
// and a symmetric cluster stays symmetric. Momentum is kept, and at e = 1 energy.
//
// Limits: dense linear algebra, its work grows with the cube of the contacts that approach at once
// (a few in practice, a hundred without harm). Where contacts are redundant, impulses are not
// unique, although the velocities are: one set of impulses is reported of many.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "ball_sim/collision_law.hpp"
#include "ball_sim/limits.hpp"
#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// Whether two impacts are at one instant: whether partners as far apart as `gap` touch already.
///
/// Times of impact are found to rounding, so that balls that a scene has meet at once may be found
/// to meet one after the other. They touch when the gap is no more than what is called touching
/// everywhere (kTouchSlack), or what rounding of their coordinates leaves uncertain.
/// @param gap     m, of the surfaces; below 0: overlap
/// @param reach   m, sum of the radii, or the radius at a wall
/// @param extent  m, magnitude of the coordinates that the gap was computed from, >= 0
template <class Real>
bool touches(Real gap, Real reach, Real extent) {
  constexpr int kUlps = 16;  // of the coordinates, of their last few roundings
  const Real rounding = kUlps * std::numeric_limits<Real>::epsilon() * extent;
  return gap <= Real(kTouchSlack) * reach + rounding;
}

/// Whether the order of two impacts that share a ball changes the outcome.
/// @param n_a, n_b  unit normals from the shared ball to its partners
/// @param w  1/kg, of the shared ball; w_a, w_b: of its partners; 0: fixed, or a wall
template <class Real>
bool orderMatters(const VectorOf<Real>& n_a, const VectorOf<Real>& n_b, Real w, Real w_a, Real w_b,
                  Real restitution) {
  using std::abs;
  using std::acos;
  using std::floor;
  using std::sqrt;
  if (!(w > 0)) return false;         // a fixed ball hands nothing on
  const Real tolerance = Real(1e-9);  // of theta: normals of balls that touch to 1e-12
  const Real cosine = -dot(n_a, n_b) * (w / sqrt((w + w_a) * (w + w_b)));
  if (abs(cosine) <= tolerance) return false;
  if (restitution < 1) return true;
  if (!(cosine < 1)) return false;
  const Real k = Real(3.14159265358979323846L) / acos(std::max(cosine, Real(-1)));
  return abs(k - floor(k + Real(0.5))) > tolerance * k * k;
}

/// Whether a contact is coming to rest: gravity presses its partners together, itself or through
/// others, and they are too slow to rise by a thousandth of their reach. What another order of such
/// impacts changes nobody sees. Along a level normal nothing presses: balls that roll towards each
/// other do not settle, however slow.
/// @param gravity  m/s^2
/// @param normal   unit, of the contact
/// @param speed    m/s, of approach, >= 0
/// @param reach    m, sum of radii, or the radius at a wall
template <class Real>
bool settles(const VectorOf<Real>& gravity, const VectorOf<Real>& normal, Real speed, Real reach,
             Real restitution) {
  using std::abs;
  using std::sqrt;
  constexpr double kSettledHeight = 1e-3;  // of the reach
  constexpr double kLevel = 1e-9;          // of gravity, along the normal
  const Real g = sqrt(dot(gravity, gravity));
  return restitution < 1 && speed * speed <= 2 * g * Real(kSettledHeight) * reach &&
         abs(dot(gravity, normal)) > Real(kLevel) * g;
}

/// A ball of a cluster.
template <class Real>
struct ClusterBody {
  VectorOf<Real> v;  ///< m/s
  Real w = 0;        ///< 1/kg; 0: fixed
};

/// Two balls of a cluster that touch, or a ball and a wall that do.
template <class Real>
struct ClusterContact {
  static constexpr std::size_t kWall = std::numeric_limits<std::size_t>::max();

  std::size_t a = 0;                                ///< index of a body
  std::size_t b = kWall;                            ///< index of another body, or kWall
  std::size_t wall = 0;                             ///< index of the wall, where b is kWall
  VectorOf<Real> normal = VectorOf<Real>::UnitX();  ///< unit, from a to b
  Real gap = 0;                                     ///< m, of the surfaces
  Real reach = 0;                                   ///< m, sum of radii, or the radius at a wall
  Real least_rebound = 0;                           ///< m/s, see collision_law.hpp
  Real approach_speed = 0;                          ///< m/s, set by keepApproaching()
  Real impulse = 0;                                 ///< N s, >= 0, set by reflectTogether()

  bool withWall() const { return b == kWall; }
};

/// Leaves those contacts whose partners approach each other, faster than rounding may pretend.
///
/// What a cluster's earlier impacts have stopped moves on at their rounding errors; such an
/// approach is no impact that others have to be taken together with.
template <class Real>
void keepApproaching(const std::vector<ClusterBody<Real>>& bodies,
                     std::vector<ClusterContact<Real>>& contacts) {
  using std::sqrt;
  constexpr int kUlps = 64;  // of the cluster's fastest ball
  Real fastest = 0;
  for (const ClusterBody<Real>& body : bodies) fastest = std::max(fastest, dot(body.v, body.v));
  const Real rounding = kUlps * std::numeric_limits<Real>::epsilon() * sqrt(fastest);
  for (ClusterContact<Real>& contact : contacts) {
    contact.approach_speed = dot(bodies[contact.a].v, contact.normal);
    if (!contact.withWall()) {
      contact.approach_speed -= dot(bodies[contact.b].v, contact.normal);
    }
  }
  contacts.erase(std::remove_if(contacts.begin(), contacts.end(),
                                [&](const ClusterContact<Real>& contact) {
                                  return !(contact.approach_speed > rounding);
                                }),
                 contacts.end());
}

/// Whether the policy decides the outcome: two of the contacts that approach share a ball, neither
/// settles, and their order would matter.
/// @param gravity  m/s^2
template <class Real>
bool orderMatters(const std::vector<ClusterBody<Real>>& bodies,
                  const std::vector<ClusterContact<Real>>& contacts, const VectorOf<Real>& gravity,
                  Real restitution) {
  const auto isSettling = [&](const ClusterContact<Real>& contact) {
    return settles<Real>(gravity, contact.normal, contact.approach_speed, contact.reach,
                         restitution);
  };
  const auto partnerAt = [&](const ClusterContact<Real>& contact, std::size_t shared) {
    const std::size_t partner = contact.a == shared ? contact.b : contact.a;
    return partner == ClusterContact<Real>::kWall ? Real(0) : bodies[partner].w;
  };
  const auto normalAt = [](const ClusterContact<Real>& contact, std::size_t shared) {
    return contact.a == shared ? contact.normal : VectorOf<Real>(-contact.normal);
  };
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    for (std::size_t j = i + 1; j < contacts.size(); ++j) {
      if (isSettling(contacts[i]) || isSettling(contacts[j])) continue;
      for (const std::size_t shared : {contacts[i].a, contacts[i].b}) {
        if (shared == ClusterContact<Real>::kWall) continue;
        if (contacts[j].a != shared && contacts[j].b != shared) continue;
        if (orderMatters<Real>(normalAt(contacts[i], shared), normalAt(contacts[j], shared),
                               bodies[shared].w, partnerAt(contacts[i], shared),
                               partnerAt(contacts[j], shared), restitution)) {
          return true;
        }
      }
    }
  }
  return false;
}

namespace detail {

/// Sums of doubles in a cluster are formed in a wider type, so that what is left after rounding is
/// nearly always the same from every order of the balls.
template <class Real>
struct Wider {
  using Type = Real;
};
template <>
struct Wider<double> {
  using Type = long double;
};

/// Finds x >= 0 with A x >= c, x.(A x - c) = 0, A = B^T B, by the active set of Lawson and Hanson
/// ("Solving Least Squares Problems", 1974, chapter 23). A is never formed, which would square its
/// condition: R of B = Q R is (Gram-Schmidt, twice), and A x = c is R^T R x = c.
template <class Real>
class NonNegativeSystem {
  using Numbers = std::vector<Real>;

 public:
  /// @param columns  of B, of length 1 each
  /// @param c        one a column, > 0
  NonNegativeSystem(const std::vector<Numbers>& columns, const Numbers& c)
      : columns_(columns), c_(c), x_(c.size(), Real(0)) {}

  Numbers solve() {
    if (solveForAll()) return x_;
    passive_.clear();
    q_.clear();
    r_.clear();
    std::fill(x_.begin(), x_.end(), Real(0));
    std::vector<bool> refused(c_.size(), false);
    const Real least = kUnresolved * *std::max_element(c_.begin(), c_.end());
    while (true) {
      const std::size_t next = steepest(refused);
      if (next == c_.size() || !(lack(next) > least)) return x_;
      if (add(next, kDependent)) {
        descend();
      } else {
        refused[next] = true;
      }
    }
  }

 private:
  static inline const Real kUnresolved = Real(1e-13);  // of the fastest approach: the next round's
  static inline const Real kIndependent = Real(1e-8);  // sine of a column to those before it
  static inline const Real kDependent = 1000 * std::numeric_limits<Real>::epsilon();

  static Real product(const Numbers& a, const Numbers& b) {
    Real sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
  }

  static void addTo(Numbers& a, Real factor, const Numbers& b) {
    for (std::size_t i = 0; i < a.size(); ++i) a[i] += factor * b[i];
  }

  // Most clusters: every contact pushes, and none depends on the others.
  bool solveForAll() {
    for (std::size_t j = 0; j < c_.size(); ++j) {
      if (!add(j, kIndependent)) return false;
    }
    x_ = passiveSolution();
    return std::all_of(x_.begin(), x_.end(), [](Real x) { return x >= 0; });
  }

  // Takes a column into the passive set, those whose x may be above 0. @return false: it depends
  // on those already there
  bool add(std::size_t j, Real least_sine) {
    using std::sqrt;
    Numbers rest = columns_[j];
    Numbers r(passive_.size() + 1, Real(0));
    for (int pass = 0; pass < 2; ++pass) {
      for (std::size_t k = 0; k < passive_.size(); ++k) {
        const Real share = product(q_[k], rest);
        r[k] += share;
        addTo(rest, -share, q_[k]);
      }
    }
    const Real length = sqrt(product(rest, rest));
    if (!(length > least_sine)) return false;
    for (Real& value : rest) value /= length;
    r.back() = length;
    q_.push_back(std::move(rest));
    r_.push_back(std::move(r));
    passive_.push_back(j);
    return true;
  }

  // The solution of A x = c on the passive set, in its order.
  Numbers passiveSolution() const {
    const std::size_t count = passive_.size();
    Numbers x(count);
    for (std::size_t k = 0; k < count; ++k) {
      x[k] = c_[passive_[k]];
      for (std::size_t i = 0; i < k; ++i) x[k] -= r_[k][i] * x[i];
      x[k] /= r_[k][k];
    }
    for (std::size_t k = count; k-- > 0;) {
      for (std::size_t i = k + 1; i < count; ++i) x[k] -= r_[i][k] * x[i];
      x[k] /= r_[k][k];
    }
    return x;
  }

  // How much is still wanted of contact j.
  Real lack(std::size_t j) const {
    Real reached = 0;
    for (const std::size_t k : passive_) reached += x_[k] * product(columns_[j], columns_[k]);
    return c_[j] - reached;
  }

  std::size_t steepest(const std::vector<bool>& refused) const {
    std::size_t best = c_.size();
    Real most = 0;
    for (std::size_t j = 0; j < c_.size(); ++j) {
      const bool is_passive = std::find(passive_.begin(), passive_.end(), j) != passive_.end();
      if (refused[j] || is_passive || !(lack(j) > most)) continue;
      most = lack(j);
      best = j;
    }
    return best;
  }

  // From x towards the passive set's solution, as far as no x falls below 0; those that get to 0
  // leave the set.
  void descend() {
    while (true) {
      const Numbers goal = passiveSolution();
      Real step = 1;
      for (std::size_t k = 0; k < goal.size(); ++k) {
        const Real x = x_[passive_[k]];
        if (goal[k] < 0) step = std::min(step, Real(x / (x - goal[k])));
      }
      std::vector<std::size_t> kept;
      for (std::size_t k = 0; k < goal.size(); ++k) {
        Real& x = x_[passive_[k]];
        const bool leaves = goal[k] < 0 && !(x / (x - goal[k]) > step);
        x = leaves ? Real(0) : Real(x + step * (goal[k] - x));
        if (!leaves) kept.push_back(passive_[k]);
      }
      if (kept.size() == goal.size()) return;
      passive_.clear();
      q_.clear();
      r_.clear();
      for (const std::size_t j : kept) add(j, Real(0));
    }
  }

  const std::vector<Numbers>& columns_;
  const Numbers& c_;
  Numbers x_;
  std::vector<std::size_t> passive_;
  std::vector<Numbers> q_;  // orthonormal columns
  std::vector<Numbers> r_;  // upper triangle, by columns
};

/// The impulses that reflect contacts at once, as a NonNegativeSystem.
template <class Real>
class JointReflection {
  using Wide = typename Wider<Real>::Type;
  using WideVector = VectorOf<Wide>;

 public:
  JointReflection(const std::vector<ClusterBody<Real>>& bodies, Real restitution)
      : bodies_(bodies), restitution_(restitution) {}

  void add(const ClusterContact<Real>& contact) {
    using std::sqrt;
    const WideVector n = wide(contact.normal);
    const Wide w_a = Wide(bodies_[contact.a].w);
    const Wide w_b = contact.withWall() ? Wide(0) : Wide(bodies_[contact.b].w);
    const Wide scale = sqrt((w_a + w_b) * dot(n, n));  // makes the column a unit vector
    std::vector<Wide> column(3 * bodies_.size(), Wide(0));
    for (std::size_t i = 0; i < 3; ++i) {
      column[3 * contact.a + i] = n[int(i)] * sqrt(w_a) / scale;
      if (!contact.withWall()) column[3 * contact.b + i] = -n[int(i)] * sqrt(w_b) / scale;
    }
    Wide approach = dot(wide(bodies_[contact.a].v), n);
    if (!contact.withWall()) approach -= dot(wide(bodies_[contact.b].v), n);
    const Wide least = approach + Wide(contact.least_rebound);
    wanted_.push_back(std::max(Wide((1 + Wide(restitution_)) * approach), least) / scale);
    scales_.push_back(scale);
    columns_.push_back(std::move(column));
  }

  /// @return N s, one a contact
  std::vector<Wide> impulses() const {
    std::vector<Wide> x = NonNegativeSystem<Wide>(columns_, wanted_).solve();
    for (std::size_t k = 0; k < x.size(); ++k) x[k] /= scales_[k];
    return x;
  }

 private:
  static WideVector wide(const VectorOf<Real>& v) { return v.template cast<Wide>(); }

  const std::vector<ClusterBody<Real>>& bodies_;
  Real restitution_;
  std::vector<std::vector<Wide>> columns_;
  std::vector<Wide> wanted_;  // m/s, change of relative speed, in units of the scale
  std::vector<Wide> scales_;  // kg^-1/2
};

/// Which contacts share a ball that can move with another one.
template <class Real>
std::vector<bool> sharing(const std::vector<ClusterBody<Real>>& bodies,
                          const std::vector<ClusterContact<Real>>& contacts) {
  std::vector<int> uses(bodies.size(), 0);
  for (const ClusterContact<Real>& contact : contacts) {
    ++uses[contact.a];
    if (!contact.withWall()) ++uses[contact.b];
  }
  const auto isShared = [&](std::size_t body) { return bodies[body].w > 0 && uses[body] > 1; };
  std::vector<bool> shares;
  for (const ClusterContact<Real>& contact : contacts) {
    shares.push_back(isShared(contact.a) || (!contact.withWall() && isShared(contact.b)));
  }
  return shares;
}

/// One contact that shares no ball, by the collision law itself.
template <class Real>
void reflectAlone(std::vector<ClusterBody<Real>>& bodies, ClusterContact<Real>& contact,
                  Real restitution) {
  ClusterBody<Real>& a = bodies[contact.a];
  if (contact.withWall()) {
    const Real speed = collideWithWall<Real>(a.v, VectorOf<Real>(-contact.normal), restitution);
    contact.impulse = (1 + restitution) * speed / a.w;
  } else {
    ClusterBody<Real>& b = bodies[contact.b];
    contact.impulse =
        collide<Real>(a.v, a.w, b.v, b.w, contact.normal, restitution, contact.least_rebound)
            .impulse;
  }
}

}  // namespace detail

/// Reflects all contacts at once: one round of the policy `simultaneous`.
/// @param bodies    their velocities are changed in place
/// @param contacts  that approach, as keepApproaching() left them; their impulses are set
/// @param restitution  0..1
template <class Real>
void reflectTogether(std::vector<ClusterBody<Real>>& bodies,
                     std::vector<ClusterContact<Real>>& contacts, Real restitution) {
  using Wide = typename detail::Wider<Real>::Type;
  using WideVector = VectorOf<Wide>;
  const std::vector<bool> shares = detail::sharing(bodies, contacts);
  detail::JointReflection<Real> joint(bodies, restitution);
  std::vector<std::size_t> together;
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    if (!shares[k]) {
      detail::reflectAlone(bodies, contacts[k], restitution);
      continue;
    }
    joint.add(contacts[k]);
    together.push_back(k);
  }
  if (together.empty()) return;
  const std::vector<Wide> impulses = joint.impulses();
  std::vector<WideVector> v;
  for (const ClusterBody<Real>& body : bodies) v.push_back(body.v.template cast<Wide>());
  for (std::size_t i = 0; i < together.size(); ++i) {
    ClusterContact<Real>& contact = contacts[together[i]];
    contact.impulse = Real(impulses[i]);
    const WideVector push = impulses[i] * contact.normal.template cast<Wide>();
    v[contact.a] -= Wide(bodies[contact.a].w) * push;
    if (!contact.withWall()) v[contact.b] += Wide(bodies[contact.b].w) * push;
  }
  for (std::size_t i = 0; i < bodies.size(); ++i) bodies[i].v = v[i].template cast<Real>();
}

/// Watches impacts taken one after the other for those whose order decided the outcome.
///
/// Costs a comparison and the storing of a few numbers an impact; only impacts at one instant that
/// share a ball are looked at closer. Remembers the first 32 impacts of an instant.
template <class Real>
class OrderWatch {
  using Vec = VectorOf<Real>;

 public:
  /// @param gravity  m/s^2
  explicit OrderWatch(const Vector3& gravity) : gravity_(gravity.cast<Real>()) {}

  /// The key of a wall, beyond all ids of balls.
  static constexpr std::uint64_t wallKey(std::size_t index) {
    return (std::uint64_t{1} << 32) + index;
  }

  /// A partner of an impact: a ball by any number that is its own, or a wall.
  struct Side {
    std::uint64_t key;
    const Vec& v;  // m/s, after the impact
    Real w;        // 1/kg; 0: fixed, or a wall
    Real change;   // m/s, what the impact took (of a) or gave (to b) along the normal
  };

  /// @param now     s, on a clock that setBack() follows
  /// @param normal  unit, from a to b
  /// @param approach_speed  m/s, > 0
  /// @param reach   m, sum of radii, or the radius at a wall
  /// @return true when another impact of this instant shares a ball with it, approached at the same
  ///         time, and would have led elsewhere had it come later; not where one of the two settles
  bool note(Real now, const Side& a, const Side& b, const Vec& normal, Real approach_speed,
            Real reach, Real restitution) {
    using std::abs;
    if (abs(now - instant_) * approach_speed <= Real(kTouchSlack) * reach) {
      return noteAnother(now, a, b, normal, approach_speed, reach, restitution);
    }
    instant_ = now;
    count_ = 1;
    impacts_[0] = {a.key, b.key, a.w, b.w, a.change, b.change, approach_speed, reach, normal};
    return false;
  }

  /// The clock starts again: its 0 is `passed` seconds later.
  void setBack(Real passed) { instant_ -= passed; }

 private:
  struct Impact {
    std::uint64_t a, b;
    Real w_a, w_b;            // 1/kg
    Real change_a, change_b;  // m/s
    Real speed;               // m/s, of approach
    Real reach;               // m
    Vec normal;               // from a to b
  };

  // Rare, so it is kept out of the callers' code.
  __attribute__((noinline)) bool noteAnother(Real now, const Side& a, const Side& b,
                                             const Vec& normal, Real approach_speed, Real reach,
                                             Real restitution) {
    if (now != instant_ && !(approach_speed > rounding(a.v, b.v, normal))) {
      return false;  // not of this instant, but slow
    }
    const bool matters = dependsOnOrder(a, b, normal, reach, restitution);
    if (count_ < impacts_.size()) {
      impacts_[count_++] = {a.key,    b.key,          a.w,   b.w,   a.change,
                            b.change, approach_speed, reach, normal};
    }
    return matters;
  }

  // What speed of approach rounding may pretend after a few impacts.
  static Real rounding(const Vec& v_a, const Vec& v_b, const Vec& normal) {
    return 4 * (roundingAlong(v_a, normal) + roundingAlong(v_b, normal));
  }

  // Undoes the impacts of this instant, last one first: did both approach before the other came?
  bool dependsOnOrder(const Side& a, const Side& b, const Vec& normal, Real reach,
                      Real restitution) const {
    Vec v_a = a.v + a.change * normal;
    Vec v_b = b.v - b.change * normal;
    const auto undo = [](const Impact& impact, std::uint64_t key, Vec& v) {
      if (key == impact.a) v += impact.change_a * impact.normal;
      if (key == impact.b) v -= impact.change_b * impact.normal;
    };
    for (std::size_t k = count_; k-- > 0;) {
      const Impact& past = impacts_[k];
      undo(past, a.key, v_a);
      undo(past, b.key, v_b);
      const bool shares_a = a.key == past.a || a.key == past.b;
      const bool shares_b = b.key == past.a || b.key == past.b;
      if (shares_a == shares_b) continue;  // none, or the same two
      const Real speed = dot(v_a, normal) - dot(v_b, normal);
      if (!(speed > rounding(v_a, v_b, normal))) continue;
      if (settles<Real>(gravity_, normal, speed, reach, restitution)) continue;
      if (settles<Real>(gravity_, past.normal, past.speed, past.reach, restitution)) continue;
      const std::uint64_t shared = shares_a ? a.key : b.key;
      const Vec here = shares_a ? normal : Vec(-normal);
      const Vec there = shared == past.a ? past.normal : Vec(-past.normal);
      if (orderMatters<Real>(here, there, shares_a ? a.w : b.w, shares_a ? b.w : a.w,
                             shared == past.a ? past.w_b : past.w_a, restitution)) {
        return true;
      }
    }
    return false;
  }

  Vec gravity_;  // m/s^2
  std::array<Impact, 32> impacts_;
  std::size_t count_ = 0;
  Real instant_ = -std::numeric_limits<Real>::infinity();  // s
};

}  // namespace ball_sim::core
