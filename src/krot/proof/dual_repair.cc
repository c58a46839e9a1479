#include "krot/proof/dual_repair.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/proof/dual_system.h"

namespace krot {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::VectorXd;

// By how much (2) stays below zero, relative to what it sums up: well above
// roundings, well below any gap.
constexpr double kConstantMargin = 1e-8;
// The bound that is claimed leaves this for the last roundings, relative.
constexpr double kBoundMargin = 4e-13;
// Lengthening y costs the bound in first order, turning it in second: lengths
// count this much at least, or as much as there is left up to lambda.
constexpr double kLengthWeight = 1e-3;
// Of a lambda, relative: a misfit would have to change by more.
constexpr double kMaxLambdaChange = 0.5;
// The first solve leaves its own rounding, the second that of Miss().
constexpr int kNumRefinements = 2;
// Each costs two solves with the one factor.
constexpr int kMaxSteps = 20;
// Steps end where the next promises less than this, of the bound.
constexpr double kSmallestGain = 1e-9;

// Directions, by rows, in which the dual ball is round (p = 2: along y and
// across it) or ends at the coordinates +-1 (otherwise), and those coordinates.
struct DualFrame {
  Matrix2d directions;
  Vector2d coordinates;  // of y / lambda; 0 across it
};

DualFrame MakeDualFrame(const Vector2d& eta, Norm norm) {
  DualFrame frame;
  if (norm.p == 2) {
    const double length = eta.norm();
    const Vector2d along = length > 0 ? Vector2d(eta / length) : Vector2d(1, 0);
    frame.directions << along[0], along[1], -along[1], along[0];
    frame.coordinates << length, 0;
  } else if (norm.p == 1) {
    frame.directions.setIdentity();
    frame.coordinates = eta;
  } else {
    frame.directions << 0.5, 0.5, 0.5, -0.5;
    frame.coordinates << eta[0] + eta[1], eta[0] - eta[1];
  }
  return frame;
}

// Alternating projections, in the one metric that Factorize fixes:
//
//   Factorize --> Balance --> Misfits --none--> Divided, kept if the best
//                    ^           |                 |
//                    |          any --> end      gains? --no--> end
//                    |                             |
//                    +---------- Shorten <--------yes
//
// After Balance (1) and (2) hold, but maybe not |y_i|_dual <= lambda_i; after
// Shorten it is the other way about; what is Divided has both.
class Repair {
 public:
  Repair(const KnownRotationProblem& problem, Norm norm, double delta,
         const std::vector<Multiplier>& multipliers,
         const RepairOptions& options)
      : norm_(norm),
        delta_(delta),
        system_(problem, delta, multipliers, kConstantMargin),
        original_(multipliers),
        solver_(options.num_threads),
        now_(multipliers),
        sufficient_bound_(options.sufficient_bound) {}

  RepairedMultipliers Run();

 private:
  bool Factorize();
  void Balance();
  std::vector<int64_t> Misfits() const;
  double LongestRatio() const;
  void Shorten();
  Certificate Divided(double ratio) const;

  const Norm norm_;
  const double delta_;
  const DualSystem system_;
  const std::vector<Multiplier> original_;
  std::vector<Matrix2d> axes_;  // unit changes of y / lambda
  LeastNormSolver solver_;
  std::vector<Multiplier> now_;
  const double sufficient_bound_;
};

bool Repair::Factorize() {
  for (const Multiplier& m : original_) {
    const DualFrame frame = MakeDualFrame(m.y / m.lambda, norm_);
    const Vector2d room =
        (1 - frame.coordinates.array().abs()).max(kLengthWeight);
    axes_.push_back(room.asDiagonal() * frame.directions);
  }
  return solver_.Factorize(system_.Changes(axes_));
}

// The least change that satisfies (1) and (2), to rounding.
void Repair::Balance() {
  for (int n = 0; n < kNumRefinements; ++n) {
    const VectorXd step = solver_.Solve(-system_.Miss(now_));
    for (size_t i = 0; i < now_.size(); ++i) {
      const Eigen::Vector3d change =
          step.segment<3>(3 * static_cast<int64_t>(i));
      const Multiplier& unit = original_[i];
      now_[i].lambda += unit.lambda * change[2];
      now_[i].y += unit.lambda * (axes_[i].transpose() * change.head<2>()) +
                   change[2] * unit.y;
    }
  }
}

std::vector<int64_t> Repair::Misfits() const {
  std::vector<int64_t> misfits;
  for (size_t i = 0; i < now_.size(); ++i) {
    if (!(std::abs(now_[i].lambda / original_[i].lambda - 1) <
          kMaxLambdaChange)) {
      misfits.push_back(static_cast<int64_t>(i));
    }
  }
  return misfits;
}

double Repair::LongestRatio() const {
  double longest = 0;
  for (const Multiplier& m : now_) {
    longest = std::max(longest, DualNorm(m.y, norm_) / m.lambda);
  }
  return longest;
}

void Repair::Shorten() {
  for (Multiplier& m : now_) {
    const DualFrame frame = MakeDualFrame(m.y / m.lambda, norm_);
    const Vector2d shortened = frame.coordinates.cwiseMin(1.0).cwiseMax(-1.0);
    m.y = m.lambda * (frame.directions.transpose() * shortened);
  }
}

Certificate Repair::Divided(double ratio) const {
  Certificate certificate;
  certificate.lower_bound = delta_ / ratio;
  for (size_t i = 0; i < now_.size(); ++i) {
    certificate.observations.push_back(
        {static_cast<int64_t>(i), now_[i].lambda, now_[i].y / ratio});
  }
  return certificate;
}

RepairedMultipliers Repair::Run() {
  RepairedMultipliers repaired;
  if (!Factorize()) return repaired;
  std::optional<Certificate>& best = repaired.certificate;
  for (int step = 0; step < kMaxSteps; ++step) {
    Balance();
    const std::vector<int64_t> misfits = Misfits();
    if (!misfits.empty()) {
      if (!best) repaired.misfits = misfits;
      break;
    }
    const double ratio = LongestRatio() / (1 - kBoundMargin);
    if (!(ratio > 0)) break;
    const double bound = delta_ / ratio;
    const double before = best ? best->lower_bound : 0;
    if (bound > before) best = Divided(ratio);
    if (bound >= sufficient_bound_) break;
    if (bound < before * (1 + kSmallestGain) && step > 1) break;
    Shorten();
  }
  return repaired;
}

}  // namespace

RepairedMultipliers RepairMultipliers(
    const KnownRotationProblem& problem, Norm norm, double delta,
    const std::vector<Multiplier>& multipliers, const RepairOptions& options) {
  if (multipliers.empty()) return {};
  return Repair(problem, norm, delta, multipliers, options).Run();
}

}  // namespace krot
