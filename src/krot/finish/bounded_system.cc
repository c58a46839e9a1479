#include "krot/finish/bounded_system.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace krot {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// No step is followed farther.
constexpr double kFurthest = 2;

}  // namespace

template <typename Cap>
BoundedSystem<Cap>::BoundedSystem(const KnownRotationProblem& problem,
                                  const Cap& cap, const ErrorLoss& loss,
                                  int32_t num_views, const Context& context)
    : problem_(problem),
      cap_(cap),
      loss_(loss),
      num_views_(num_views),
      loop_(static_cast<int64_t>(problem.observations.size()), context),
      structure_(AnchoredStructure(problem, context)),
      rig_from_world_(RigFromWorldRotations(problem)),
      least_squares_(structure_, context),
      root_(problem.observations.size()),
      correction_(problem.observations.size()),
      d_(problem.observations.size()) {}

// The determinant as a sum of what is not negative: near the cap the normals'
// part is many orders of magnitude above the rest.
template <typename Cap>
typename BoundedSystem<Cap>::Root BoundedSystem<Cap>::RootOf(int64_t i) const {
  const Vector2d& e = (*viewed_)[i].e;
  const Vector& l = (*multipliers_)[i];
  const Vector h = cap_.Slacks(e);
  const Vector stiffness = l.cwiseQuotient(h);
  const Eigen::Matrix<double, 2, Cap::kNum> n = cap_.Normals(e);
  const double own = WeightOf(i) + Cap::kBend * l.sum();
  const Vector nx2 = n.row(0).cwiseAbs2(), ny2 = n.row(1).cwiseAbs2();
  const double xx = stiffness.dot(nx2), yy = stiffness.dot(ny2);
  double xy = 0;
  double determinant = own * (own + xx + yy);
  for (int j = 0; j < Cap::kNum; ++j) {
    xy += stiffness[j] * n(0, j) * n(1, j);
    for (int k = 0; k < j; ++k) {
      const double cross = n(0, j) * n(1, k) - n(1, j) * n(0, k);
      determinant += stiffness[j] * stiffness[k] * cross * cross;
    }
  }
  const double a = std::sqrt(own + xx);
  return {a, xy / a, std::sqrt(determinant) / a, std::sqrt(l.dot(h))};
}

template <typename Cap>
bool BoundedSystem<Cap>::Factorize(const std::vector<ViewedError>& viewed,
                                   const std::vector<Vector>& multipliers) {
  viewed_ = &viewed;
  multipliers_ = &multipliers;
  loop_.ForEach([&](int64_t i) {
    const Observation& o = problem_.observations[i];
    const ViewedError& at = viewed[i];
    const Root U = root_[i] = RootOf(i);
    const double scale = 1 / at.depth;
    const Eigen::RowVector3d Jx = scale * (o.E.row(1) - at.e[0] * o.E.row(0));
    const Eigen::RowVector3d Jy = scale * (o.E.row(2) - at.e[1] * o.E.row(0));
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> B;
    B << U.a * Jx + U.b * Jy, U.c * Jy, U.depth * scale * o.E.row(0);
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
        least_squares_.rows(i))
        .noalias() = B * problem_.views[o.view].cam_from_world_rotation;
  });
  return least_squares_.Factorize();
}

// The gradient of an observation's part of the barrier problem, by its error.
template <typename Cap>
Vector2d BoundedSystem<Cap>::PullOf(int64_t i) const {
  const Vector2d& e = (*viewed_)[i].e;
  const Correction c = CorrectionOf(i);
  const Vector target =
      Vector::Constant(mu_) - c.product + c.slack * (*multipliers_)[i];
  return WeightOf(i) * e +
         cap_.Normals(e) * target.cwiseQuotient(cap_.Slacks(e));
}

template <typename Cap>
void BoundedSystem<Cap>::SolveForTarget() {
  loop_.ForEach([&](int64_t i) {
    const Vector2d pull = PullOf(i);
    const Root& U = root_[i];
    const double x = -pull[0] / U.a;
    d_[i] << x, (-pull[1] - U.b * x) / U.c, 0;
  });
  // A rank may have no observation.
  double* const rows = d_.empty() ? nullptr : d_[0].data();
  least_squares_.Solve(nullptr, rows, &dx_, rows);
  loop_.ForEach([&](int64_t i) {
    Vector3d& d = d_[i];
    const Root& U = root_[i];
    d[1] /= U.c;
    d[0] = (d[0] - U.b * d[1]) / U.a;
    d[2] /= U.depth;
  });
  reach_ = FollowDirection();
}

template <typename Cap>
typename BoundedSystem<Cap>::Reach BoundedSystem<Cap>::FollowDirection() {
  return loop_.Reduce(
      Reach{kFurthest, kFurthest, 0, 0, 0, 0},
      [&](int64_t i) {
        const PairStep step = StepOf(i);
        const Vector& l = (*multipliers_)[i];
        Reach reach = {ReachOf(i),          kFurthest,
                       step.h.dot(l),       step.dh.dot(l),
                       step.h.dot(step.dl), step.dh.dot(step.dl)};
        for (int j = 0; j < Cap::kNum; ++j) {
          if (-step.dl[j] * reach.dual > l[j]) reach.dual = -l[j] / step.dl[j];
        }
        return reach;
      },
      [](const Reach& a, const Reach& b) {
        return Reach{std::min(a.primal, b.primal),
                     std::min(a.dual, b.dual),
                     a.gap + b.gap,
                     a.by_primal + b.by_primal,
                     a.by_dual + b.by_dual,
                     a.by_both + b.by_both};
      });
}

// A step t takes the depth to w + t dw and the error along de by
// a = t / (1 + t dw / w): to all of a >= 0 if the depth vanishes on the way.
template <typename Cap>
double BoundedSystem<Cap>::ReachOf(int64_t i) const {
  const double dw = d_[i][2];
  const double limit = 1 + kFurthest * dw > 0 ? kFurthest : -1 / dw;
  const double furthest = limit == kFurthest
                              ? kFurthest / (1 + kFurthest * dw)
                              : std::numeric_limits<double>::infinity();
  const double a =
      cap_.MaxStep((*viewed_)[i].e, d_[i].template head<2>(), furthest);
  return a < furthest ? a / (1 - a * dw) : limit;
}

template <typename Cap>
void BoundedSystem<Cap>::Solve(double mu) {
  mu_ = mu;
  is_corrected_ = false;
  SolveForTarget();
}

template <typename Cap>
void BoundedSystem<Cap>::Correct(double mu) {
  loop_.ForEach([&](int64_t i) {
    const PairStep step = StepOf(i);
    correction_[i] = {step.dh.cwiseProduct(step.dl),
                      Cap::kBend * d_[i].template head<2>().squaredNorm() / 2};
  });
  mu_ = mu;
  is_corrected_ = true;
  SolveForTarget();
}

template <typename Cap>
typename BoundedSystem<Cap>::PairStep BoundedSystem<Cap>::StepOf(
    int64_t i) const {
  const Vector2d& e = (*viewed_)[i].e;
  const Vector& l = (*multipliers_)[i];
  const Correction c = CorrectionOf(i);
  PairStep step;
  step.h = cap_.Slacks(e);
  step.dh = -(cap_.Normals(e).transpose() * d_[i].template head<2>()) -
            Vector::Constant(c.slack);
  step.dl = (Vector::Constant(mu_) - c.product - l.cwiseProduct(step.dh))
                .cwiseQuotient(step.h) -
            l;
  return step;
}

template <typename Cap>
double BoundedSystem<Cap>::Slope() const {
  return loop_.Sum(
      [&](int64_t i) { return -PullOf(i).dot(d_[i].template head<2>()); });
}

template class BoundedSystem<DiscCap>;
template class BoundedSystem<PolygonCap>;

}  // namespace krot
