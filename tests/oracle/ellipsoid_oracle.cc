#include "tests/oracle/ellipsoid_oracle.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace krot::internal {
namespace {

using Real = long double;
using Real2 = Eigen::Matrix<Real, 2, 1>;
using Real3 = Eigen::Matrix<Real, 3, 1>;
using Real33 = Eigen::Matrix<Real, 3, 3>;

constexpr int kMaxCuts = 6000;
constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

// ||v||_p and a dual vector s: ||s||_q = 1, s'v = ||v||_p.
struct NormAndDual {
  Real norm;
  Real2 s;
};

NormAndDual Differentiate(const Real2& v, double p) {
  const Real a = std::abs(v[0]);
  const Real b = std::abs(v[1]);
  const Real2 sign(std::copysign(Real(1), v[0]), std::copysign(Real(1), v[1]));
  if (p == 1) return {a + b, sign};
  if (std::isinf(p)) {
    return a > b ? NormAndDual{a, {sign[0], 0}} : NormAndDual{b, {0, sign[1]}};
  }
  const Real largest = std::max(a, b);
  if (!(largest > 0)) return {0, {0, 0}};
  const Real exponent = p;
  const Real powers = std::pow(a / largest, exponent - 1);
  const Real powers_b = std::pow(b / largest, exponent - 1);
  // sum |v_k|^p, in units of the largest.
  const Real sum = (powers * a + powers_b * b) / largest;
  const Real root = std::pow(sum, 1 / exponent);
  const Real scale = root / sum;  // sum^(1/p - 1)
  return {largest * root,
          {sign[0] * powers * scale, sign[1] * powers_b * scale}};
}

struct LoewnerEllipsoid {
  Real3 center;
  Real33 P;  // {z : (z - center)' P^-1 (z - center) <= 1}

  // max of g'(z - center) over the ellipsoid.
  Real Reach(const Real3& g) const {
    return std::sqrt(std::max(Real(0), g.dot(P * g)));
  }

  // Keeps what satisfies value + g'(z - center) <= 0; false if nothing does
  // or rounding has flattened the ellipsoid.
  bool Cut(const Real3& g, Real value) {
    const Real reach = Reach(g);
    const Real depth = value / reach;
    if (!(reach > 0) || !(depth < 1)) return false;
    constexpr Real n = 3;
    const Real3 direction = P * g / reach;
    center -= (1 + n * depth) / (n + 1) * direction;
    const Real shrink = 2 * (1 + n * depth) / ((n + 1) * (1 + depth));
    P = n * n / (n * n - 1) * (1 - depth * depth) *
        (P - shrink * direction * direction.transpose());
    P = (P + P.transpose().eval()) / 2;
    return true;
  }
};

// One residual at the centre of an ellipsoid.
struct Tangent {
  Real norm;
  Real depth;
  Real3 Ats;
  Real3 c;

  Tangent(const Residual& residual, const Real3& x, double p) {
    const Real2 v = residual.A.cast<Real>() * x + residual.b.cast<Real>();
    const NormAndDual dual = Differentiate(v, p);
    norm = dual.norm;
    Ats = residual.A.cast<Real>().transpose() * dual.s;
    c = residual.c.cast<Real>();
    depth = c.dot(x) + residual.d;
  }

  Real Cost() const { return depth > 0 ? norm / depth : kInfinity; }
  Real3 CutNormal(Real gamma) const { return Ats - gamma * c; }

  // A delta <= gamma that this residual exceeds all over the ellipsoid:
  // norm - delta depth >= reach(A's - delta c), which follows from
  //
  //   norm - gamma depth + (gamma - delta) depth
  //     >= reach(A's - gamma c) + (gamma - delta) reach(c).
  Real LowerBound(Real gamma, const LoewnerEllipsoid& ellipsoid) const {
    const Real room = depth - ellipsoid.Reach(c);
    if (!(room > 0)) return 0;
    const Real slack =
        ellipsoid.Reach(CutNormal(gamma)) - (norm - gamma * depth);
    return gamma - std::max(Real(0), slack) / room;
  }
};

}  // namespace

OracleOptimum MinimizeByEllipsoids(const std::vector<Residual>& residuals,
                                   Norm norm, const Eigen::Vector3d& center,
                                   double radius, double gap) {
  LoewnerEllipsoid ellipsoid{center.cast<Real>(),
                             Real33::Identity() * Real(radius) * Real(radius)};
  Real3 best_x = ellipsoid.center;
  Real best = kInfinity;
  Real bound = 0;
  std::vector<Tangent> tangents;
  for (int cut = 0; cut < kMaxCuts; ++cut) {
    Real cost = 0;
    tangents.clear();
    for (const Residual& residual : residuals) {
      tangents.emplace_back(residual, ellipsoid.center, norm.p);
      cost = std::max(cost, tangents.back().Cost());
    }
    if (cost < best) {
      best = cost;
      best_x = ellipsoid.center;
    }
    Real deepest = -kInfinity;
    Real3 normal = Real3::Zero();
    Real value = 0;
    const auto consider = [&](const Real3& g, Real g0) {
      const Real depth = g0 / ellipsoid.Reach(g);
      if (!(depth > deepest)) return;
      deepest = depth;
      normal = g;
      value = g0;
    };
    for (const Tangent& tangent : tangents) {
      if (!(tangent.depth > 0)) consider(-tangent.c, -tangent.depth);
      if (std::isfinite(best)) {
        consider(tangent.CutNormal(best), tangent.norm - best * tangent.depth);
        // What was cut away costs at least `best` or has no positive depth.
        bound = std::max(bound, tangent.LowerBound(best, ellipsoid));
      }
    }
    if (best - bound <= gap) break;
    if (!ellipsoid.Cut(normal, value)) break;
  }
  return {best_x.cast<double>(), static_cast<double>(best),
          static_cast<double>(bound)};
}

}  // namespace krot::internal
