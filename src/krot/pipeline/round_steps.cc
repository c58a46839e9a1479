#include "krot/pipeline/rounds.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "krot/base/parallel_for.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;
using Basis = Eigen::Matrix<double, 2, 3>;

// Orthonormal basis of the plane across the ray of x_hat.
Basis BasisAcross(const Vector3d& x_hat) {
  const Vector3d n = x_hat.normalized();
  const Vector3d b1 = n.unitOrthogonal();
  Basis basis;
  basis << b1.transpose(), n.cross(b1).transpose();
  return basis;
}

}  // namespace

int64_t TrustRegions::Shrink(const Reprojection& reprojection,
                             const KnownRotationProblem& problem,
                             const Estimate& from, const Estimate& to,
                             Norm norm, double level) {
  int64_t count = 0;
  const auto num_observations =
      static_cast<int64_t>(problem.observations.size());
  for (int64_t i = 0; i < num_observations; ++i) {
    if (!reprojection.IsOfModel(i) ||
        !(reprojection.Error(to, norm, i) > level))
      continue;
    const Observation& observation = problem.observations[i];
    const Basis basis = BasisAcross(reprojection.InCamera(from, i));
    const Vector3d x_cam = reprojection.InCamera(to, i);
    const double way = (basis * x_cam).norm() / observation.E.row(0).dot(x_cam);
    const auto [entry, is_new] = radii_.emplace(i, way / 2);
    if (!is_new) entry->second = std::min(entry->second, way) / 2;
    ++count;
  }
  return count;
}

KnownRotationProblem TrustRegions::AddTo(
    const KnownRotationProblem& rows, const Estimate& x_hat, double level,
    std::vector<int64_t>* observation_of) const {
  KnownRotationProblem problem = rows;
  problem.observations.clear();
  observation_of->clear();
  for (int32_t k = 0; k < rows.num_points; ++k) {
    const int64_t begin = rows.point_begin[k];
    const int64_t end = rows.point_begin[k + 1];
    for (int64_t i = begin; i < end; ++i) {
      problem.observations.push_back(rows.observations[i]);
      observation_of->push_back(i);
    }
    for (auto bound = radii_.lower_bound(begin);
         bound != radii_.end() && bound->first < end; ++bound) {
      Observation row = rows.observations[bound->first];
      const View& view = rows.views[row.view];
      row.E.bottomRows<2>() =
          level / bound->second *
          BasisAcross(
              InCamera(CamFromWorld(view, x_hat.translations[view.frame]),
                       x_hat.points[row.point]));
      problem.observations.push_back(row);
      observation_of->push_back(-1);
    }
  }
  IndexObservations(&problem);
  return problem;
}

namespace {

// Line searches try a step of 1, then steps shorter by this factor each.
constexpr double kShorter = 0.7;
constexpr double kShortestStep = 1e-3;

}  // namespace

Estimate BestOnSegment(const Reprojection& reprojection, const Estimate& from,
                       const Estimate& to, Norm norm, const Context& context,
                       double* step) {
  const auto cost_of = [&](const Estimate& estimate) {
    return MaxOfRanks(context, reprojection.LevelledCost(estimate, norm,
                                                         context.num_threads));
  };
  Estimate best = from;
  double best_cost = cost_of(from);
  *step = 0;
  for (double trial = 1; trial >= kShortestStep; trial *= kShorter) {
    Estimate candidate = trial == 1 ? to : Between(from, to, trial);
    const double cost = cost_of(candidate);
    if (cost < best_cost) {
      best = std::move(candidate);
      best_cost = cost;
      *step = trial;
    } else if (*step > 0) {
      break;
    }
  }
  return best;
}

Estimate BestPointsOnSegments(const Reprojection& reprojection,
                              const KnownRotationProblem& problem,
                              const Estimate& from, const Estimate& to,
                              Norm norm, int num_threads) {
  Estimate best = to;
  const auto cost_of = [&](int64_t k) {
    double cost = 0;
    for (const int64_t i : problem.OfPoint(k)) {
      cost = std::max(cost, reprojection.Error(best, norm, i));
    }
    return cost;
  };
  ParallelForEach(problem.num_points, num_threads, [&](int64_t k) {
    best.points[k] = from.points[k];
    const double before = cost_of(k);
    double step = 1;
    do {
      best.points[k] =
          step == 1 ? to.points[k]
                    : from.points[k] + step * (to.points[k] - from.points[k]);
      step *= kShorter;
    } while (cost_of(k) > before && step >= kShortestStep);
    if (cost_of(k) > before) best.points[k] = from.points[k];
  });
  return best;
}

KeptPositions::KeptPositions(const Model& model,
                             const SolveModelOptions& options,
                             const Context& context,
                             const Reprojection& reprojection,
                             const Estimate& start, BuiltProblem* built)
    : model_(model),
      options_(options),
      context_(context),
      reprojection_(reprojection),
      built_(*built),
      tolerance_(0.2 * options.joint.relative_gap) {
  if (!Any()) return;
  // The errors of a start may be almost zero.
  built_.position_level = std::max(TrueCost(start), 1e-3);
  Keep(start);
}

// The level of the next solve, a little above the fixed point so that positions
// are kept; none if the present level is good enough. `optimum` is that of the
// rows and `cost` the levelled cost of the estimate, in pixels; `ratio` is the
// largest ratio of a camera's distance from its position to its radius.
std::optional<double> KeptPositions::NextLevel(double optimum, double cost,
                                               double ratio,
                                               bool is_held_back) {
  // The smallest slope that is assumed when choosing how far above the fixed
  // point the next level is.
  constexpr double kLeastSlope = 0.5;
  const double level = built_.position_level;
  const bool is_kept = ratio <= 1 + kKeptInRounds;
  // Where no position holds a camera back, the level does not matter.
  if (is_kept && !is_held_back && level * ratio < (1 - tolerance_) * cost) {
    return std::nullopt;
  }
  if (!(optimum > 0)) return std::nullopt;
  const double x = std::log(level);
  const double y = std::log(optimum);
  // Levels nearer than that to each other do not determine a slope, which is
  // below 1.
  if (last_ && std::abs(x - last_->first) > 1e-5) {
    slope_ = std::clamp((y - last_->second) / (x - last_->first), 0.0, 0.98);
  }
  last_ = {x, y};
  // In logarithms: if the level is e above the fixed point, the cost is about
  // slope e above it, so the excess is (1 - slope) e.
  // Whatever the slope, an excess a quarter above the largest that is chosen
  // below is never good enough.
  const double excess = x - std::log(cost);
  if (is_kept && slope_ * excess <= 2 * (1 - slope_) * tolerance_ &&
      excess <= 1.25 / kLeastSlope * tolerance_) {
    return std::nullopt;
  }
  // As G rises slower than L, the fixed point is beyond y when seen from x.
  if (y > x) lowest_ = std::max(lowest_, y);
  if (y < x) highest_ = std::min(highest_, y);
  double target = (y - slope_ * x) / (1 - slope_);
  if (lowest_ < highest_) {
    target = std::clamp(target, lowest_, highest_);
  }
  return std::exp(target + tolerance_ / std::max(slope_, kLeastSlope));
}

void KeptPositions::Keep(const Estimate& estimate) {
  if (LargestPositionRatio(built_, estimate) > 1 + kKeptInRounds) return;
  const double cost = TrueCost(estimate);
  if (!(cost < cost_)) return;
  estimate_ = estimate;
  cost_ = cost;
}

bool KeptPositions::TakeLevel(const Estimate& estimate, double optimum,
                              double cost, bool is_held_back) {
  const std::optional<double> level = NextLevel(
      optimum, cost, LargestPositionRatio(built_, estimate), is_held_back);
  if (level) SetLevel(estimate, *level);
  return level.has_value();
}

void KeptPositions::SetLevel(const Estimate& estimate, double level) const {
  built_.position_level = level;
  TakePositionRows(built_, estimate, &built_.problem);
}

// Only a bound that is at least the level of the rows it was proved with holds
// for the positions themselves.
std::optional<PixelCertificate> KeptPositions::Refute(
    const Estimate& estimate, const Certificate& rows,
    std::vector<int64_t> support) const {
  if (!(rows.lower_bound >
        std::max(built_.position_level, options_.init_max_error))) {
    return std::nullopt;
  }
  std::optional<PixelCertificate> proof =
      ProveInPixels(model_, built_, estimate, options_.norm, std::move(support),
                    rows.lower_bound, context_);
  if (!proof || !(proof->lower_bound > options_.init_max_error)) {
    return std::nullopt;
  }
  return proof;
}

std::optional<PixelCertificate> KeptPositions::Prove(
    const Estimate& estimate, const std::vector<int64_t>& support,
    double sufficient) const {
  const double level = built_.position_level;
  const double cost = TrueCost(estimate);
  std::optional<PixelCertificate> proof;
  for (const double share : {0.3, 0.6, 0.9}) {
    SetLevel(estimate, (1 - share * options_.joint.relative_gap) * cost);
    proof = ProveInPixels(model_, built_, estimate, options_.norm, support,
                          sufficient, context_);
    if (proof) break;
  }
  SetLevel(estimate, level);
  return proof;
}

}  // namespace krot::internal
