#include "krot/tolerance/extent.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/conic/interior_point.h"

namespace krot::internal {
namespace {

// If p'x grows by more than so many times the size of the scene, there is no
// end to find.
constexpr double kFarAway = 1e4;
// A proof is tried once the gap is below so many times the tolerance, because a
// later one, with a smaller gap, may fail.
constexpr double kFirstProof = 20;
// The relative rounding error of the few operations after the check.
constexpr double kRounding = 8 * std::numeric_limits<double>::epsilon();

// The upper bound of p'x that the multipliers prove, if any.
std::optional<double> Prove(const KnownRotationProblem& problem,
                            const Pull& pull,
                            const std::optional<ScaleRow>& scale,
                            const ExtentOptions& options, const Estimate& start,
                            const std::vector<Multiplier>& multipliers) {
  ExtentCertificate certificate;
  certificate.bound = options.bound;
  certificate.pulls = {pull};
  for (size_t i = 0; i < multipliers.size(); ++i) {
    certificate.observations.push_back(
        {static_cast<int64_t>(i), multipliers[i].lambda, multipliers[i].y});
  }
  double kept = 0;
  if (scale) {
    Pull keeper = *scale;
    keeper.direction *=
        BalancingPull(problem, certificate, scale->index, scale->direction);
    certificate.pulls.push_back(keeper);
    kept = Along(problem, start, keeper);
  }
  const ExtentCheck check = CheckExtent(problem, options.norm, certificate);
  if (!check.is_accepted) return std::nullopt;
  return check.extent - kept +
         kRounding * (std::abs(check.extent) + std::abs(kept));
}

// The largest distance of a frame or a point from the pull's position.
double SizeOf(const KnownRotationProblem& problem, const Estimate& estimate,
              const Pull& pull) {
  const Eigen::Vector3d x = PositionOf(problem, estimate, pull);
  double size = 0;
  for (size_t v = 0; v < problem.views.size(); ++v) {
    const Pull other{Pull::Kind::kView, static_cast<int32_t>(v)};
    size = std::max(size, (PositionOf(problem, estimate, other) - x).norm());
  }
  for (const Eigen::Vector3d& point : estimate.points) {
    size = std::max(size, (point - x).norm());
  }
  return size;
}

}  // namespace

Extent FindExtent(const KnownRotationProblem& problem, const Pull& pull,
                  const std::optional<ScaleRow>& scale,
                  const ExtentOptions& options, const Context& context,
                  const Estimate& start) {
  Extent extent;
  extent.estimate = start;
  LinearObjective objective;
  objective.h.SetZero(problem.num_points, problem.num_frames);
  objective.h.Add(-1, CoefficientsOf(problem, pull));
  if (scale) objective.e = CoefficientsOf(problem, *scale);
  const double at_start = Along(problem, start, pull);
  const double far_away = kFarAway * SizeOf(problem, start, pull);

  InteriorPointOptions interior_point;
  interior_point.norm = options.norm;
  interior_point.max_iterations = options.max_iterations;
  interior_point.stop = [&](const ConicIterate& iterate) {
    const double reached = Along(problem, *iterate.estimate, pull);
    if (reached - at_start > far_away) return true;
    if (iterate.gap > kFirstProof * options.tolerance) return false;
    const std::optional<double> proved =
        Prove(problem, pull, scale, options, start, *iterate.multipliers);
    if (!proved) return false;
    extent.proved = std::min(*proved, extent.proved.value_or(*proved));
    return *extent.proved - reached <=
           options.tolerance * (*extent.proved - at_start);
  };
  std::vector<Multiplier> multipliers;
  extent.iterations =
      MinimizeLinear(problem, interior_point, context, options.bound, objective,
                     &extent.estimate, &multipliers)
          .iterations;
  return extent;
}

// A view's centre moves as its frame's does.
BlockVector CoefficientsOf(const KnownRotationProblem& problem,
                           const Pull& pull) {
  BlockVector coefficients;
  coefficients.SetZero(problem.num_points, problem.num_frames);
  if (pull.kind == Pull::Kind::kPoint) {
    if (problem.IsFixedPoint(pull.index)) return coefficients;
    coefficients.points[pull.index] = pull.direction;
    return coefficients;
  }
  const View& view = problem.views[pull.index];
  if (problem.IsFixedFrame(view.frame)) return coefficients;
  coefficients.frames[view.frame] = pull.direction;
  return coefficients;
}

}  // namespace krot::internal
