#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "krot/finish/least_squares.h"
#include "krot/geometry.h"
#include "krot/linear/ordered_sums.h"
#include "krot/linear/schur_complement.h"
#include "krot/problem/gauge.h"

namespace krot::internal {

// ||e||_p <= cap as kNum conditions h_j(e) >= 0 on an error e, pixels. Each cap
// offers, at e,
//
//   Slacks         h_j > 0 inside
//   Normals        n_j = -dh_j/de, as columns
//   kBend          -d^2 h_j / de^2 = kBend I
//   MaxStep        the largest t <= limit with e + t d inside; h = Slacks(e)
//   RelativeSlack  of slacks h_j, the product of all h_j / h_j(0)
// Share          of multipliers: their weight, where an error's own is 1

// p = 2: h = (cap^2 - |e|^2) / 2.
struct DiscCap {
  static constexpr int kNum = 1;
  static constexpr double kBend = 1;
  using Vector = Eigen::Matrix<double, kNum, 1>;

  DiscCap(Norm, double cap_px) : cap(cap_px) {}

  Vector Slacks(const Eigen::Vector2d& e) const {
    const double norm = e.norm();
    return Vector((cap - norm) * (cap + norm) / 2);
  }
  Eigen::Matrix<double, 2, kNum> Normals(const Eigen::Vector2d& e) const {
    return e;
  }
  // The positive root of |d|^2 t^2 + 2 e'd t = 2 h, without cancellation.
  double MaxStep(const Eigen::Vector2d& e, const Vector& h,
                 const Eigen::Vector2d& d, double limit) const {
    const double h2 = 2 * h[0];
    const double b = e.dot(d);
    const double root = std::sqrt(b * b + d.squaredNorm() * h2);
    const double t = b > 0 ? h2 / (b + root) : (root - b) / d.squaredNorm();
    return t < limit ? t : limit;
  }
  double RelativeSlack(const Vector& h) const { return 2 * h[0] / (cap * cap); }
  double Share(const Vector& multiplier) const { return multiplier[0]; }

  double cap;
};

// p = 1 or infinity: h_j = cap - n_j'e.
struct PolygonCap {
  static constexpr int kNum = 4;
  static constexpr double kBend = 0;
  using Vector = Eigen::Matrix<double, kNum, 1>;

  PolygonCap(Norm norm, double cap_px) : cap(cap_px) {
    if (norm.p == 1) {
      normals << 1, 1, -1, -1, 1, -1, 1, -1;
    } else {
      normals << 1, -1, 0, 0, 0, 0, 1, -1;
    }
  }

  Vector Slacks(const Eigen::Vector2d& e) const {
    return Vector::Constant(cap) - normals.transpose() * e;
  }
  const Eigen::Matrix<double, 2, kNum>& Normals(const Eigen::Vector2d&) const {
    return normals;
  }
  double MaxStep(const Eigen::Vector2d&, const Vector& h,
                 const Eigen::Vector2d& d, double limit) const {
    const Vector fall = normals.transpose() * d;
    for (int j = 0; j < kNum; ++j) {
      if (fall[j] * limit > h[j]) limit = h[j] / fall[j];
    }
    return limit;
  }
  double RelativeSlack(const Vector& h) const { return (h / cap).prod(); }
  double Share(const Vector& multipliers) const {
    return multipliers.maxCoeff() / cap;
  }

  double cap;
  Eigen::Matrix<double, 2, kNum> normals;
};

// An observation's error e = v / w, pixels, its depth w, and Slacks(e).
template <typename Cap>
struct ViewedError {
  Eigen::Vector2d e;
  double depth;
  typename Cap::Vector h;
};

// The Newton system of bounded least squares at an iterate, in pixels. With
// slacks h_j(e), multipliers l_j and J = de/dx_cam = (E_v - e E_w) / w, a
// direction solves, to first order,
//
//   sum J'(rho' (e + de) + sum_j (l_j + dl_j) n_j(e + de)) = 0,   de = J dx,
//   (h_j + dh_j)(l_j + dl_j) = mu,   dh_j = -n_j'de.
//
// dl eliminated, an observation's rows are
//
//   [        U J         ]    U'U = (rho' + kBend sum_j l_j) I
//   [ sqrt(h'l) E_w / w  ]          + sum_j l_j / h_j n_j n_j'
//
// The last row holds back points whose depths the errors hardly tell, as the
// barrier of the cone of (cap w; v) would; it vanishes with mu. The right-hand
// side, -(rho' e + sum_j mu / h_j n_j), is minus the gradient of the barrier
// problem: any l > 0 gives a descent direction.
//
// The unknowns are points and frames' centres.
template <typename Cap>
class BoundedSystem {
 public:
  using Vector = typename Cap::Vector;
  using Viewed = ViewedError<Cap>;
  using Vector2d = Eigen::Vector2d;
  using Vector3d = Eigen::Vector3d;

  // Keeps a reference to `problem`, whose rows Factorize reads. Observations of
  // views after the first `num_views` are bounds alone.
  BoundedSystem(const KnownRotationProblem& problem, const Cap& cap,
                const ErrorLoss& loss, int32_t num_views,
                const Context& context)
      : problem_(problem),
        cap_(cap),
        loss_(loss),
        num_views_(num_views),
        loop_(static_cast<int64_t>(problem.observations.size()), context),
        structure_(AnchoredStructure(problem, context)),
        rig_from_world_(RigFromWorldRotations(problem)),
        least_squares_(structure_, context,
                       ReducedCameraSystem::Use::kRoughSolutions),
        root_(problem.observations.size()),
        correction_(problem.observations.size()),
        d_(problem.observations.size()) {}

  // Builds the system at an iterate; errors and multipliers must outlive the
  // calls below. False if there is no factor.
  bool Factorize(const std::vector<Viewed>& viewed,
                 const std::vector<Vector>& multipliers) {
    viewed_ = &viewed;
    multipliers_ = &multipliers;
    loop_.ForEach([&](int64_t i) {
      const Observation& o = problem_.observations[i];
      const Viewed& at = viewed[i];
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

  // Newton's direction for the barrier problem of this mu.
  void Solve(double mu) {
    mu_ = mu;
    is_corrected_ = false;
    SolveForTarget();
  }

  // Newton's direction with the second-order terms of products and slacks along
  // the last one [Mehrotra 1992].
  void Correct(double mu) {
    loop_.ForEach([&](int64_t i) {
      const PairStep step = StepOf(i);
      correction_[i] = {
          step.dh.cwiseProduct(step.dl),
          Cap::kBend * d_[i].template head<2>().squaredNorm() / 2};
    });
    mu_ = mu;
    is_corrected_ = true;
    SolveForTarget();
  }

  void Move(const Estimate& from, double step, Estimate* to) const {
    MoveCentres(rig_from_world_, from, step, dx_, to);
  }
  // The slacks and multipliers of observation i along the last direction.
  struct PairStep {
    Vector h, dh, dl;
  };
  PairStep StepOf(int64_t i) const {
    const Vector2d& e = (*viewed_)[i].e;
    const Vector& l = (*multipliers_)[i];
    const Correction c = CorrectionOf(i);
    PairStep step;
    step.h = (*viewed_)[i].h;
    step.dh = -(cap_.Normals(e).transpose() * d_[i].template head<2>()) -
              Vector::Constant(c.slack);
    step.dl = (Vector::Constant(mu_) - c.product - l.cwiseProduct(step.dh))
                  .cwiseQuotient(step.h) -
              l;
    return step;
  }

  // The longest step <= 1 along dx that keeps all errors below the cap, if the
  // rows stay as they are, times `damping`, which is >= 1 / 2.
  double MaxStep(double damping) const {
    return std::min(1.0, damping * reach_.primal);
  }
  // The sum of h'l that the last direction promises, to second order: after the
  // longest steps <= 1, of dx and of all dl, at which all errors are below the
  // cap and all multipliers positive.
  double PredictedGap() const {
    const double primal = std::min(1.0, reach_.primal);
    const double dual = std::min(1.0, reach_.dual);
    return reach_.gap + primal * reach_.by_primal + dual * reach_.by_dual +
           primal * dual * reach_.by_both;
  }
  // Twice what a full step gains in the quadratic model; squared pixels.
  double Slope() const {
    return loop_.Sum(
        [&](int64_t i) { return -PullOf(i).dot(d_[i].template head<2>()); });
  }

  const ObservationLoop& loop() const { return loop_; }
  const Cap& cap() const { return cap_; }

 private:
  // Longer steps are not looked at.
  static constexpr double kFurthest = 2;

  // What an observation's rows are made of: U = [a b; 0 c] and sqrt(h'l).
  struct Root {
    double a, b, c, depth;
  };
  // Second-order terms along Newton's direction: of h_j l_j, and of each h_j.
  struct Correction {
    Vector product;
    double slack;
  };
  // Along the last direction: the longest steps <= 2, and the sum of h'l as a
  // polynomial in the two step lengths.
  struct Reach {
    double primal, dual;
    double gap, by_primal, by_dual, by_both;
  };

  // rho' of an observation's error.
  double WeightOf(int64_t i) const {
    return problem_.observations[i].view < num_views_
               ? loss_.Weight((*viewed_)[i].e.squaredNorm())
               : 0;
  }
  // The determinant is a sum of terms that are not negative: near the cap the
  // normals' part is many orders of magnitude above the rest.
  Root RootOf(int64_t i) const {
    const Vector2d& e = (*viewed_)[i].e;
    const Vector& l = (*multipliers_)[i];
    const Vector& h = (*viewed_)[i].h;
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

  Correction CorrectionOf(int64_t i) const {
    return is_corrected_ ? correction_[i] : Correction{Vector::Zero(), 0};
  }
  // The gradient of an observation's part of the barrier problem, by its error.
  Eigen::Vector2d PullOf(int64_t i) const {
    const Vector2d& e = (*viewed_)[i].e;
    const Correction c = CorrectionOf(i);
    const Vector target =
        Vector::Constant(mu_) - c.product + c.slack * (*multipliers_)[i];
    return WeightOf(i) * e +
           cap_.Normals(e) * target.cwiseQuotient((*viewed_)[i].h);
  }

  // A step t takes the depth to w + t dw and the error along de by
  // a = t / (1 + t dw / w): to all of a >= 0 if the depth vanishes on the way.
  double ReachOf(int64_t i) const {
    const double dw = d_[i][2];
    const double limit = 1 + kFurthest * dw > 0 ? kFurthest : -1 / dw;
    const double furthest = limit == kFurthest
                                ? kFurthest / (1 + kFurthest * dw)
                                : std::numeric_limits<double>::infinity();
    const Viewed& at = (*viewed_)[i];
    const double a =
        cap_.MaxStep(at.e, at.h, d_[i].template head<2>(), furthest);
    return a < furthest ? a / (1 - a * dw) : limit;
  }

  void SolveForTarget() {
    loop_.ForEach([&](int64_t i) {
      const Vector2d pull = PullOf(i);
      const Root& U = root_[i];
      const double x = -pull[0] / U.a;
      d_[i] << x, (-pull[1] - U.b * x) / U.c, 0;
    });
    // A rank may have no observation.
    double* const rows = d_.empty() ? nullptr : d_[0].data();
    // The next step corrects the direction's error in the energy norm.
    least_squares_.Solve(nullptr, rows, /*tolerance=*/1e-3, &dx_, rows);
    reach_ = FollowDirection();
  }

  // Turns the solution's image in d_ into steps of the errors, and follows
  // them.
  Reach FollowDirection() {
    return loop_.Reduce(
        Reach{kFurthest, kFurthest, 0, 0, 0, 0},
        [&](int64_t i) {
          Vector3d& d = d_[i];
          const Root& U = root_[i];
          d[1] /= U.c;
          d[0] = (d[0] - U.b * d[1]) / U.a;
          d[2] /= U.depth;
          const PairStep step = StepOf(i);
          const Vector& l = (*multipliers_)[i];
          Reach reach = {ReachOf(i),          kFurthest,
                         step.h.dot(l),       step.dh.dot(l),
                         step.h.dot(step.dl), step.dh.dot(step.dl)};
          for (int j = 0; j < Cap::kNum; ++j) {
            if (-step.dl[j] * reach.dual > l[j])
              reach.dual = -l[j] / step.dl[j];
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

  const KnownRotationProblem& problem_;
  const Cap cap_;
  const ErrorLoss loss_;
  const int32_t num_views_;
  const ObservationLoop loop_;
  const BlockStructure structure_;
  const std::vector<Eigen::Matrix3d> rig_from_world_;
  CentredLeastSquares<3> least_squares_;
  const std::vector<Viewed>* viewed_ = nullptr;
  const std::vector<Vector>* multipliers_ = nullptr;
  double mu_ = 0;
  bool is_corrected_ = false;
  std::vector<Root> root_;
  std::vector<Correction> correction_;
  // At first the right-hand side of the rows, then (de; dw / w).
  std::vector<Eigen::Vector3d> d_;
  BlockVector dx_;
  Reach reach_ = {};
};

}  // namespace krot::internal
