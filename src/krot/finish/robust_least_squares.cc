#include "krot/finish/least_squares.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/linear/ordered_sums.h"
#include "krot/linear/schur_complement.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"

namespace krot::internal {
namespace {

// The last c, relative to the median.
constexpr double kFactor = 2;

class RobustLeastSquares {
 public:
  RobustLeastSquares(const KnownRotationProblem& problem, double tolerance,
                     const Context& context, Estimate* estimate)
      : problem_(problem),
        tolerance_(tolerance),
        context_(context),
        loop_(static_cast<int64_t>(problem.observations.size()),
              context.num_threads),
        structure_(AnchoredStructure(problem)),
        rig_from_world_(RigFromWorldRotations(problem)),
        least_squares_(structure_, {context.num_threads},
                       ReducedCameraSystem::Use::kRoughSolutions),
        target_(3 * problem.observations.size()),
        estimate_(*estimate) {}

  void Run() {
    squared_errors_ = SquaredErrors(estimate_);
    if (squared_errors_.empty()) return;
    TakeScale();
    // If fewer than half of the points are seen, there is no scale.
    const int max_steps = 30;
    for (int n = 0; n < max_steps && std::isfinite(scale2_); ++n) {
      context_.Stage("improving the start, step", n + 1, max_steps);
      if (context_.IsCancelled() || !TakeStep()) break;
    }
  }

 private:
  // r_i^2; infinite where the point is not seen.
  std::vector<double> SquaredErrors(const Estimate& estimate) const {
    const std::vector<AffineMap> cameras =
        CamerasFromWorld(problem_, estimate.translations);
    std::vector<double> squared(problem_.observations.size());
    loop_.ForEach([&](int64_t i) {
      const Observation& o = problem_.observations[i];
      const double error = ResidualOf(
          ViewPoint(cameras[o.view], o, estimate.points[o.point]), Norm::L2());
      squared[i] = error * error;
    });
    return squared;
  }

  void TakeScale() {  // a scale below 1e-6 pixels would be that of rounding
    std::vector<double> squared = squared_errors_;
    ShareErrorsOfPairs(problem_, &squared);
    scale2_ = std::pow(
        std::max(1e-6, factor_ * std::sqrt(Median(std::move(squared)))), 2);
  }
  double Cost(const std::vector<double>& squared_errors) const {
    return loop_.Sum([&](int64_t i) {
      return std::isfinite(squared_errors[i])
                 ? scale2_ * squared_errors[i] / (scale2_ + squared_errors[i])
                 : scale2_;
    });
  }

  // The rows of every observation, sqrt(weight) times (dr; damping dw / w).
  void Linearize() {
    using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    const std::vector<AffineMap> cameras =
        CamerasFromWorld(problem_, estimate_.translations);
    const double damping = damping_ * std::sqrt(scale2_);
    loop_.ForEach([&](int64_t i) {
      Eigen::Map<Rows> rows(least_squares_.rows(i));
      Eigen::Map<Eigen::Vector3d> target(&target_[3 * i]);
      rows.setZero();
      target.setZero();
      if (!std::isfinite(squared_errors_[i])) return;
      const Observation& o = problem_.observations[i];
      const View& view = problem_.views[o.view];
      const ViewedPoint viewed =
          ViewPoint(cameras[o.view], o, estimate_.points[o.point]);
      const double root_weight = scale2_ / (scale2_ + squared_errors_[i]);
      const Eigen::Vector2d r = viewed.v / viewed.depth;
      Rows by_x_cam;
      by_x_cam.topRows<2>() = o.E.bottomRows<2>() - r * o.E.row(0);
      by_x_cam.row(2) = damping * o.E.row(0);
      rows =
          root_weight / viewed.depth * by_x_cam * view.cam_from_world_rotation;
      target.head<2>() = -root_weight * r;
    });
  }

  bool FindStep() {
    Linearize();
    if (!least_squares_.Factorize()) return false;
    // The linear model does not hold far from here.
    least_squares_.Solve(nullptr, target_.data(), /*tolerance=*/1e-2, &step_,
                         nullptr);
    // A point that no observation sees has no rows, and stays.
    for (Eigen::Vector3d& s : step_.points) {
      if (!s.allFinite()) s.setZero();
    }
    return std::all_of(step_.frames.begin(), step_.frames.end(),
                       [](const Eigen::Vector3d& c) { return c.allFinite(); });
  }

  // Takes a step. Returns whether the sum fell by enough to go on.
  bool TakeStep() {
    const double before = Cost(squared_errors_);
    Estimate moved = estimate_;
    for (int n = 0; n < 8 && !context_.IsCancelled(); ++n) {
      if (FindStep()) {
        MoveCentres(rig_from_world_, estimate_, 1, step_, &moved);
        std::vector<double> squared_errors = SquaredErrors(moved);
        const double after = Cost(squared_errors);
        if (after < before) {
          damping_ = std::max(1e-3, damping_ / 4);
          estimate_ = std::move(moved);
          squared_errors_ = std::move(squared_errors);
          const bool is_wide = factor_ > kFactor;
          factor_ = std::max(kFactor, factor_ / 2);
          TakeScale();
          return is_wide || after < (1 - tolerance_) * before;
        }
      }
      damping_ *= 4;
    }
    return false;
  }

  const KnownRotationProblem& problem_;
  const double tolerance_;
  const Context& context_;
  const ObservationLoop loop_;
  const BlockStructure structure_;
  const std::vector<Eigen::Matrix3d> rig_from_world_;
  CentredLeastSquares<3> least_squares_;
  std::vector<double> target_;
  Estimate& estimate_;
  std::vector<double> squared_errors_;  // there
  double factor_ = 16;                  // c / median
  double scale2_ = 0;                   // c^2
  double damping_ = 1;                  // in units of c
  BlockVector step_;
};

// Inverse iteration of what FindSoftestMotion minimises.
class SoftestMotionSearch {
 public:
  SoftestMotionSearch(const KnownRotationProblem& problem,
                      const Estimate& estimate, double sigma,
                      const Context& context)
      : problem_(problem),
        sigma_(sigma),
        count_(static_cast<int64_t>(problem.observations.size())),
        structure_(AnchoredStructure(problem)),
        least_squares_(structure_, context),
        by_depth_(problem.observations.size(), Eigen::Vector3d::Zero()),
        changes_(problem.observations.size(), 0) {
    Linearize(estimate);
    ChooseTelling();
  }

  SoftestMotion Run() {
    SoftestMotion softest;
    softest.changes.resize(problem_.num_frames);
    for (int64_t i = 0; i < count_; ++i) {
      Rows rows(least_squares_.rows(i));
      if (is_telling_[i]) {
        rows.row(2) = kDepthWeight * sigma_ * by_depth_[i].transpose();
        changes_[i] = std::sin(problem_.FrameOf(i) + 1);
      }
    }
    if (!least_squares_.Factorize()) return softest;
    std::vector<double> image(3 * count_);
    BlockVector motion;
    for (int n = 0; n < 10; ++n) {
      TakeOutScale();
      std::fill(image.begin(), image.end(), 0);
      for (int64_t i = 0; i < count_; ++i) image[3 * i + 2] = changes_[i];
      least_squares_.Solve(nullptr, image.data(), SchurComplement::kTolerance,
                           &motion, image.data());
      double most = 0;
      for (int64_t i = 0; i < count_; ++i) {
        changes_[i] = image[3 * i + 2] / (kDepthWeight * sigma_);
        most = std::max(most, std::abs(changes_[i]));
      }
      if (!(most > 0 && std::isfinite(most))) return softest;
      for (double& change : changes_) change /= most;
      for (double& number : image) number /= most;
    }
    double sum = 0;
    for (int64_t i = 0; i < count_; ++i) {
      sum += Eigen::Map<Eigen::Vector2d>(&image[3 * i]).squaredNorm();
    }
    for (int32_t f = 0; f < problem_.num_frames; ++f) {
      std::vector<double> changes;
      for (const int32_t i : problem_.OfFrame(f)) {
        if (is_telling_[i]) changes.push_back(changes_[i]);
      }
      if (!changes.empty()) softest.changes[f] = Median(std::move(changes));
    }
    softest.deviation = sigma_ / std::sqrt(sum);
    return softest;
  }

 private:
  using Rows = Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>;
  // A relative depth counts as little as so many standard deviations.
  static constexpr double kDepthWeight = 1e-3;
  static constexpr double kTellingDepth = 0.1;
  static constexpr size_t kTellingTracks = 3;

  // The changes dr of errors, and of relative depths, by s - C.
  void Linearize(const Estimate& estimate) {
    for (int64_t i = 0; i < count_; ++i) {
      const Observation& o = problem_.observations[i];
      const ViewedPoint viewed = ViewPoint(problem_, o, estimate);
      Rows rows(least_squares_.rows(i));
      rows.setZero();
      if (!std::isfinite(ResidualOf(viewed, Norm::L2()))) continue;
      const Eigen::Matrix3d by_point =
          problem_.views[o.view].cam_from_world_rotation / viewed.depth;
      by_depth_[i] = (o.E.row(0) * by_point).transpose();
      rows.topRows<2>() =
          (o.E.bottomRows<2>() - viewed.v / viewed.depth * o.E.row(0)) *
          by_point;
    }
  }

  // Marks the observations whose relative depth is known to a tenth where
  // frames stand still.
  void ChooseTelling() {
    is_telling_.assign(count_, 0);
    for (int32_t k = 0; k < problem_.num_points; ++k) {
      std::vector<double> rows;
      for (const int64_t i : problem_.OfPoint(k)) {
        rows.insert(rows.end(), least_squares_.rows(i),
                    least_squares_.rows(i) + 6);
      }
      const UpperTriangle R =
          Orthogonalize(static_cast<int64_t>(rows.size()) / 3, rows.data());
      if (std::isinf(R.r00) || std::isinf(R.r11) || std::isinf(R.r22)) continue;
      for (const int64_t i : problem_.OfPoint(k)) {
        is_telling_[i] =
            by_depth_[i] != Eigen::Vector3d::Zero() &&
            sigma_ * R.SolveTransposed(by_depth_[i]).norm() < kTellingDepth;
      }
    }
    for (int32_t f = 0; f < problem_.num_frames; ++f) {
      size_t num_telling = 0;
      for (const int32_t i : problem_.OfFrame(f)) num_telling += is_telling_[i];
      if (num_telling >= kTellingTracks) continue;
      for (const int32_t i : problem_.OfFrame(f)) is_telling_[i] = 0;
    }
  }

  void TakeOutScale() {
    if (HasBaseline(problem_)) return;
    double sum = 0, count = 0;
    for (int64_t i = 0; i < count_; ++i) {
      sum += changes_[i];
      count += is_telling_[i];
    }
    for (int64_t i = 0; i < count_; ++i) {
      if (is_telling_[i]) changes_[i] -= sum / count;
    }
  }

  const KnownRotationProblem& problem_;
  const double sigma_;   // pixels
  const int64_t count_;  // of observations
  const BlockStructure structure_;
  CentredLeastSquares<3> least_squares_;
  std::vector<Eigen::Vector3d> by_depth_;  // dw / w by s - C
  std::vector<double> changes_;            // dw / w
  std::vector<char> is_telling_;
};

}  // namespace

void ShareErrorsOfPairs(const KnownRotationProblem& problem,
                        std::vector<double>* squared_errors) {
  for (int32_t k = 0; k < problem.num_points; ++k) {
    if (problem.point_begin[k + 1] - problem.point_begin[k] != 2) continue;
    double* const pair = &(*squared_errors)[problem.point_begin[k]];
    pair[0] = pair[1] = (pair[0] + pair[1]) / 2;
  }
}

void MinimizeRobustly(const KnownRotationProblem& problem,
                      const Context& context, Estimate* estimate,
                      double tolerance) {
  RobustLeastSquares(problem, tolerance, context, estimate).Run();
}

SoftestMotion FindSoftestMotion(const KnownRotationProblem& problem,
                                const Estimate& estimate, double sigma,
                                const Context& context) {
  return SoftestMotionSearch(problem, estimate, sigma, context).Run();
}

}  // namespace krot::internal
