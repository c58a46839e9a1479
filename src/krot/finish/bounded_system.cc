#include "krot/finish/bounded_system.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace krot {

using Eigen::Vector2d;
using Eigen::Vector3d;

template <typename Cap>
BoundedSystem<Cap>::BoundedSystem(const KnownRotationProblem& problem,
                                  const Cap& cap, const ErrorLoss& loss,
                                  int num_threads)
    : problem_(problem),
      cap_(cap),
      loss_(loss),
      loop_(static_cast<int64_t>(problem.observations.size()), num_threads),
      structure_(AnchoredStructure(problem)),
      elimination_(structure_, num_threads),
      root_(problem.observations.size()),
      correction_(problem.observations.size()),
      rhs_(problem.observations.size()),
      d_(problem.observations.size()) {
  zero_.SetZero(problem.num_points, problem.num_frames);
}

// The determinant as a sum of what is not negative: near the cap the normals'
// part is many orders of magnitude above the rest.
template <typename Cap>
typename BoundedSystem<Cap>::Root BoundedSystem<Cap>::RootOf(int64_t i) const {
  const Vector2d& e = (*viewed_)[i].e;
  const Vector& l = (*multipliers_)[i];
  const Vector stiffness = l.cwiseQuotient(cap_.Slacks(e));
  const Eigen::Matrix<double, 2, Cap::kNum> n = cap_.Normals(e);
  const double own = loss_.Weight(e.squaredNorm()) + Cap::kBend * l.sum();
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
  return {a, xy / a, std::sqrt(determinant) / a};
}

template <typename Cap>
bool BoundedSystem<Cap>::Factorize(const std::vector<Observation>& observations,
                                   const std::vector<ViewedError>& viewed,
                                   const std::vector<Vector>& multipliers) {
  observations_ = &observations;
  viewed_ = &viewed;
  multipliers_ = &multipliers;
  loop_.ForEach([&](int64_t i) {
    const Observation& o = observations[i];
    const View& view = problem_.views[o.view];
    const ViewedError& at = viewed[i];
    root_[i] = RootOf(i);
    const double scale = 1 / at.depth;
    const Vector3d Jx = scale * (o.E.row(1) - at.e[0] * o.E.row(0));
    const Vector3d Jy = scale * (o.E.row(2) - at.e[1] * o.E.row(0));
    Matrix3 R;
    R.row(0) = root_[i].a * Jx + root_[i].b * Jy;
    R.row(1) = root_[i].c * Jy;
    R.row(2) =
        std::sqrt(multipliers[i].dot(cap_.Slacks(at.e))) * scale * o.E.row(0);
    Eigen::Map<Matrix3>(elimination_.point_rows(i)).noalias() =
        R * view.cam_from_world_rotation;
    Eigen::Map<Matrix3>(elimination_.frame_rows(i)).noalias() =
        R * view.cam_from_rig_rotation;
  });
  return elimination_.Factorize();
}

// The gradient of an observation's part of the barrier problem, by its error.
template <typename Cap>
Vector2d BoundedSystem<Cap>::PullOf(int64_t i) const {
  const Vector2d& e = (*viewed_)[i].e;
  const Correction& c = correction_[i];
  const Vector target =
      Vector::Constant(mu_) - c.product + c.slack * (*multipliers_)[i];
  return loss_.Weight(e.squaredNorm()) * e +
         cap_.Normals(e) * target.cwiseQuotient(cap_.Slacks(e));
}

template <typename Cap>
void BoundedSystem<Cap>::SolveForTarget() {
  loop_.ForEach([&](int64_t i) {
    const Vector2d pull = PullOf(i);
    const Root& U = root_[i];
    const double x = -pull[0] / U.a;
    rhs_[i] << x, (-pull[1] - U.b * x) / U.c, 0;
  });
  elimination_.Solve(zero_, rhs_.data()->data(), &dx_, /*refinements=*/0);
  loop_.ForEach([&](int64_t i) {
    const Observation& o = (*observations_)[i];
    const View& view = problem_.views[o.view];
    const ViewedError& at = (*viewed_)[i];
    const Vector3d dwv = o.E *
                         (view.cam_from_world_rotation * dx_.points[o.point] +
                          view.cam_from_rig_rotation * dx_.frames[view.frame]) /
                         at.depth;
    d_[i] = {dwv.tail<2>() - dwv[0] * at.e, dwv[0]};
  });
}

template <typename Cap>
void BoundedSystem<Cap>::Solve(double mu) {
  mu_ = mu;
  std::fill(correction_.begin(), correction_.end(), Correction());
  SolveForTarget();
}

template <typename Cap>
void BoundedSystem<Cap>::Correct(double mu) {
  loop_.ForEach([&](int64_t i) {
    const PairStep step = StepOf(i);
    correction_[i] = {step.dh.cwiseProduct(step.dl),
                      Cap::kBend * d_[i].e.squaredNorm() / 2};
  });
  mu_ = mu;
  SolveForTarget();
}

template <typename Cap>
typename BoundedSystem<Cap>::PairStep BoundedSystem<Cap>::StepOf(
    int64_t i) const {
  const Vector2d& e = (*viewed_)[i].e;
  const Vector& l = (*multipliers_)[i];
  const Correction& c = correction_[i];
  PairStep step;
  step.h = cap_.Slacks(e);
  step.dh =
      -(cap_.Normals(e).transpose() * d_[i].e) - Vector::Constant(c.slack);
  step.dl = (Vector::Constant(mu_) - c.product - l.cwiseProduct(step.dh))
                .cwiseQuotient(step.h) -
            l;
  return step;
}

// A step t takes the depth to w + t dw and the error along de by
// a = t / (1 + t dw / w): to all of a >= 0 if the depth vanishes on the way.
template <typename Cap>
double BoundedSystem<Cap>::MaxStep(double damping) const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return damping * loop_.Min([&](int64_t i) {
    const double dw = d_[i].depth;
    const double ahead = 1 / damping;
    const double limit = 1 + ahead * dw > 0 ? ahead : -1 / dw;
    const double furthest =
        limit == ahead ? ahead / (1 + ahead * dw) : kInfinity;
    const double a = cap_.MaxStep((*viewed_)[i].e, d_[i].e, furthest);
    return a < furthest ? a / (1 - a * dw) : limit;
  });
}

template <typename Cap>
double BoundedSystem<Cap>::MaxDualStep(double damping) const {
  return damping * loop_.Min([&](int64_t i) {
    const Vector dl = StepOf(i).dl;
    double limit = 1 / damping;
    for (int j = 0; j < Cap::kNum; ++j) {
      const double l = (*multipliers_)[i][j];
      if (-dl[j] * limit > l) limit = -l / dl[j];
    }
    return limit;
  });
}

template <typename Cap>
double BoundedSystem<Cap>::Slope() const {
  return loop_.Sum([&](int64_t i) { return -PullOf(i).dot(d_[i].e); });
}

template <typename Cap>
int64_t BoundedSystem<Cap>::MemoryBytes(const KnownRotationProblem& problem) {
  constexpr int64_t kPerObservation =
      sizeof(Root) + sizeof(Correction) + sizeof(Vector3d) +
      sizeof(ViewedError) + 3 * 9 * sizeof(double) +  // A_s, A_t, Q
      2 * sizeof(int32_t);                            // structure and order
  constexpr int64_t kPerUnknown = 4 * sizeof(Vector3d);
  return static_cast<int64_t>(problem.observations.size()) * kPerObservation +
         (problem.num_points + problem.num_frames) * kPerUnknown +
         FrameSystem(AnchoredStructure(problem)).MemoryBytes();
}

template class BoundedSystem<DiscCap>;
template class BoundedSystem<PolygonCap>;

}  // namespace krot
