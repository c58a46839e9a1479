#include "krot/minimax/newton_descent.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "krot/base/check.h"

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Up to this many residuals are all in the working set from the start.
constexpr int kSmallSet = 16;
constexpr int kAddedPerTrial = 4;
// Stop when a nearly unregularised step promises less than this, relative.
constexpr double kPredictionTolerance = 1e-12;
// Residuals this small are zero, in pixels.
constexpr double kZeroPixels = 1e-10;
// No depth grows beyond this multiple of its start: farther away nothing
// changes by more than 1e-6 of it.
constexpr double kMaxDepthGrowth = 1e6;
// The regularisation relative to the natural curvature |grad|^2 / cost.
constexpr double kInitialKappa = 1e-2;
constexpr double kSmallestKappa = 1e-9;
constexpr double kLargestKappa = 1e9;
// Below this, what the step bears on the residuals is rounding.
constexpr double kSmallestWeight = 1e-9;
// A trial is taken if it keeps this share of its promise.
constexpr double kSufficientDecrease = 1e-3;

}  // namespace

void NewtonDescent::StartWorkingSet(const ResidualSet& residuals) {
  working_set_.clear();
  is_member_.assign(residuals.size(), 0);
  if (residuals.size() <= kSmallSet) {
    AddViolators(residuals, -1);
    return;
  }
  const double* values = residuals.values();
  const double cost = *std::max_element(values, values + residuals.size());
  AddViolators(residuals, 0.9 * cost);
}

// Adds the largest residuals above `level` that are not members yet: a few,
// or all of a small set. Returns whether there were any.
bool NewtonDescent::AddViolators(const ResidualSet& residuals, double level) {
  const double* values = residuals.values();
  const int limit =
      residuals.size() <= kSmallSet ? residuals.size() : kAddedPerTrial;
  bool added = false;
  for (int n = 0; n < limit; ++n) {
    int largest = -1;
    double value = level;
    for (int i = 0; i < residuals.size(); ++i) {
      if (values[i] > value && !is_member_[i]) {
        value = values[i];
        largest = i;
      }
    }
    if (largest < 0) break;
    is_member_[largest] = 1;
    working_set_.push_back({largest, 0, 0, residuals[largest].Depth(x_start_)});
    added = true;
  }
  return added;
}

void NewtonDescent::Linearize(const ResidualSet& residuals, const Vector3d& x,
                              Norm norm) {
  pieces_.assign(1, {});  // no residual falls below zero
  member_of_piece_.assign(1, -1);
  for (size_t m = 0; m < working_set_.size(); ++m) {
    ResidualPiece pieces[kMaxPieces];
    const int count = ResidualPieces(residuals[working_set_[m].residual], x,
                                     norm, /*share=*/-1, pieces);
    for (int k = 0; k < count; ++k) {
      pieces_.push_back(pieces[k]);
      member_of_piece_.push_back(static_cast<int>(m));
    }
  }
}

Vector3d NewtonDescent::SolveStep(double cost, double kappa, double* level) {
  Matrix3d H = Matrix3d::Zero();
  double natural = 0;
  for (size_t k = 1; k < pieces_.size(); ++k) {
    const ResidualPiece& piece = pieces_[k];
    natural = std::max(natural, piece.gradient.squaredNorm());
    const double weight =
        working_set_[member_of_piece_[k]].multiplier * piece.curvature;
    if (weight > 0) H += weight * piece.bend * piece.bend.transpose();
  }
  H.diagonal().array() += kappa * natural / cost;
  const Eigen::LLT<Matrix3d> llt(H);

  // With H = L L', the step in L'd has unit curvature.
  scaled_pieces_.resize(pieces_.size());
  for (size_t k = 0; k < pieces_.size(); ++k) {
    scaled_pieces_[k].value = pieces_[k].value;
    scaled_pieces_[k].gradient = llt.matrixL().solve(pieces_[k].gradient);
  }
  SolveSimplexQp(scaled_pieces_.data(), static_cast<int>(scaled_pieces_.size()),
                 &solution_);
  *level = solution_.level;
  return llt.matrixU().solve(solution_.step);
}

// Takes the multipliers of the last step, over the residuals alone and with
// sum 1: at a positive optimum the zero piece bears none. A step that failed
// only adds to them. Returns whether they have grown anywhere.
bool NewtonDescent::UpdateMultipliers(bool step_failed) {
  constexpr int kZeroPiece = 0;
  double sum = 0;
  for (int k = 0; k < solution_.size; ++k) {
    if (solution_.index[k] != kZeroPiece) sum += solution_.weight[k];
  }
  if (!(sum > kSmallestWeight)) return false;
  for (Member& member : working_set_) {
    member.last_multiplier = 0;
    if (!step_failed) member.multiplier = 0;
  }
  for (int k = 0; k < solution_.size; ++k) {
    if (solution_.index[k] == kZeroPiece) continue;
    working_set_[member_of_piece_[solution_.index[k]]].last_multiplier +=
        solution_.weight[k] / sum;
  }
  bool grown = false;
  for (Member& member : working_set_) {
    grown |= member.last_multiplier > 2 * member.multiplier + 1e-3;
    member.multiplier = std::max(member.multiplier, member.last_multiplier);
  }
  return grown;
}

// The largest share of the step, at most 1, that keeps depths within
// kMaxDepthGrowth.
double NewtonDescent::DepthLimit(const ResidualSet& residuals,
                                 const Vector3d& x,
                                 const Vector3d& step) const {
  double share = 1;
  for (const Member& member : working_set_) {
    const Residual r = residuals[member.residual];
    const double growth = r.c.dot(step);
    const double room = kMaxDepthGrowth * member.start_depth - r.Depth(x);
    if (growth > 0 && room < share * growth)
      share = std::max(0.0, room / growth);
  }
  return share;
}

DescentSummary NewtonDescent::Minimize(ResidualSet* residuals, Norm norm,
                                       int max_iterations, Vector3d* x) {
  DescentSummary summary;
  double cost = residuals->Evaluate(*x, norm);
  summary.cost_initial = summary.cost = cost;
  CheckArgument(std::isfinite(cost), "cost at the start", cost,
                "finite: all depths positive");
  x_start_ = *x;
  solution_.size = 0;
  StartWorkingSet(*residuals);
  Linearize(*residuals, *x, norm);

  double kappa = 1;  // the first multipliers come from a gradient step
  double level = 0;
  if (cost > kZeroPixels) {
    SolveStep(cost, kappa, &level);
    UpdateMultipliers(false);
    kappa = kInitialKappa;
  }
  summary.termination = DescentTermination::kMaxIterations;
  while (summary.iterations < max_iterations) {
    if (!(cost > kZeroPixels)) {
      summary.termination = DescentTermination::kZeroCost;
      break;
    }
    Vector3d step = SolveStep(cost, kappa, &level);
    const double promise = cost - level;
    if (!(promise > kPredictionTolerance * cost)) {
      if (kappa > kSmallestKappa) {  // it may be small for kappa's sake
        UpdateMultipliers(true);
        kappa = kSmallestKappa;
        ++summary.iterations;
        continue;
      }
      summary.termination = DescentTermination::kStationary;
      break;
    }
    const double share = DepthLimit(*residuals, *x, step);
    if (!(share > 1e-9)) {
      summary.termination = DescentTermination::kFarAway;
      break;
    }
    step *= share;
    ++summary.iterations;
    const Vector3d x_trial = *x + step;
    const double cost_trial = residuals->Evaluate(x_trial, norm);
    const double kept = (cost - cost_trial) / (share * promise);
    const bool has_violators = AddViolators(*residuals, level);
    if (kept > kSufficientDecrease) {
      *x = x_trial;
      cost = cost_trial;
      UpdateMultipliers(false);
      Linearize(*residuals, *x, norm);
      kappa = kept > 0.5   ? std::max(kappa * 0.01, kSmallestKappa)
              : kept < 0.1 ? kappa * 4
                           : kappa;
    } else if (has_violators) {
      Linearize(*residuals, *x, norm);
    } else if (!UpdateMultipliers(true)) {
      kappa = std::max(kappa * 10, 1e-5);
      if (kappa > kLargestKappa) {
        summary.termination = DescentTermination::kNoDecrease;
        break;
      }
    }
  }
  summary.cost = cost;
  return summary;
}

}  // namespace krot
