#include "krot/tolerance/tolerance_analysis.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

#include "krot/conic/interior_point.h"
#include "krot/convert/reprojection.h"
#include "krot/problem/cost.h"
#include "krot/problem/subset.h"
#include "krot/sweeps/res_int.h"

namespace krot::internal {
namespace {

// The upper bound of the sum that the multipliers prove, if any.
std::optional<double> Prove(const KnownRotationProblem& problem,
                            const Pulls& pulls,
                            const std::optional<ScaleRow>& scale,
                            const ExtentOptions& options, const Estimate& start,
                            const std::vector<Multiplier>& multipliers) {
  ExtentCertificate certificate;
  certificate.bound = options.bound;
  certificate.pulls = pulls;
  for (size_t i = 0; i < multipliers.size(); ++i) {
    certificate.observations.push_back(
        {static_cast<int64_t>(i), multipliers[i].lambda, multipliers[i].y});
  }
  double kept = 0;
  if (scale) {
    Pull keeper = *scale;
    keeper.direction *= BalancingPull(problem, certificate, *scale);
    certificate.pulls.push_back(keeper);
    kept = Along(problem, start, keeper);
  }
  const ExtentCheck check = CheckExtent(problem, options.norm, certificate);
  if (!check.is_accepted) return std::nullopt;
  return check.extent - kept +
         kProofRounding * (std::abs(check.extent) + std::abs(kept));
}

// The largest distance of a frame or a point from a pull's position.
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

double Along(const KnownRotationProblem& problem, const Estimate& estimate,
             const Pulls& pulls) {
  double sum = 0;
  for (const Pull& pull : pulls) sum += Along(problem, estimate, pull);
  return sum;
}

Extent FindExtent(const KnownRotationProblem& problem, const Pulls& pulls,
                  const std::optional<ScaleRow>& scale,
                  const ExtentOptions& options, const Context& context,
                  const Estimate& start) {
  Extent extent;
  extent.estimate = start;
  LinearObjective objective;
  objective.h.SetZero(problem.num_points, problem.num_frames);
  objective.h.Add(-1, CoefficientsOf(problem, pulls));
  if (scale) objective.e = CoefficientsOf(problem, {*scale});
  const double at_start = Along(problem, start, pulls);
  // Beyond so many times the size of the scene there is no end to find.
  const double far_away = 1e4 * SizeOf(problem, start, pulls.front());

  InteriorPointOptions interior_point;
  interior_point.norm = options.norm;
  interior_point.max_iterations = 100;
  interior_point.stop = [&](const ConicIterate& iterate) {
    const double reached = Along(problem, *iterate.estimate, pulls);
    if (reached - at_start > far_away) return true;
    // Proofs are tried early: later ones, with a smaller gap, may fail.
    if (iterate.gap > 20 * options.tolerance) return false;
    const std::optional<double> proved =
        Prove(problem, pulls, scale, options, start, *iterate.multipliers);
    if (!proved) return false;
    extent.proved = std::min(*proved, extent.proved.value_or(*proved));
    return *extent.proved - reached <=
           options.tolerance * (*extent.proved - at_start);
  };
  std::vector<Multiplier> multipliers;
  MinimizeLinear(problem, interior_point, context, options.bound, objective,
                 &extent.estimate, &multipliers);
  return extent;
}

// A view's centre moves as its frame's does.
BlockVector CoefficientsOf(const KnownRotationProblem& problem,
                           const Pulls& pulls) {
  BlockVector coefficients;
  coefficients.SetZero(problem.num_points, problem.num_frames);
  for (const Pull& pull : pulls) {
    if (IsFixedPosition(problem, pull)) continue;
    if (pull.kind == Pull::Kind::kPoint) {
      coefficients.points[pull.index] += pull.direction;
    } else {
      coefficients.frames[problem.views[pull.index].frame] += pull.direction;
    }
  }
  return coefficients;
}

namespace {

using Eigen::Vector3d;

// Moves all cameras of a frame to one place, and frees what is fixed, so that a
// point or a frame matters as a direction only.
KnownRotationProblem WithoutPositions(KnownRotationProblem problem) {
  for (View& view : problem.views) view.cam_from_rig_translation.setZero();
  problem.fixed_translations.clear();
  problem.fixed_points.clear();
  return problem;
}

enum class Kind { kPoints, kFrames };

// All in one place but the points, or the frames: these are where the sum of
// their unit rays leads.
Estimate MeanDirections(const KnownRotationProblem& problem, Kind kind) {
  Estimate estimate;
  estimate.translations.assign(problem.num_frames, Vector3d::Zero());
  estimate.points.assign(problem.num_points, Vector3d::Zero());
  for (const Observation& o : problem.observations) {
    const View& view = problem.views[o.view];
    const Vector3d ray = o.E.inverse().col(0).normalized();
    if (kind == Kind::kPoints) {
      estimate.points[o.point] +=
          view.cam_from_world_rotation.transpose() * ray;
    } else {
      estimate.translations[view.frame] +=
          view.cam_from_rig_rotation.transpose() * ray;
    }
  }
  return estimate;
}

Vector3d CentreAt(const KnownRotationProblem& problem, const Estimate& estimate,
                  int32_t view) {
  return PositionOf(problem, estimate, {Pull::Kind::kView, view});
}

// Holds a view's frame, or a point, where the estimate has it.
void Fix(const Pull& what, const Estimate& at, KnownRotationProblem* problem) {
  if (what.kind == Pull::Kind::kPoint) {
    problem->fixed_points.resize(problem->num_points);
    problem->fixed_points[what.index] = at.points[what.index];
    return;
  }
  const int32_t frame = problem->views[what.index].frame;
  problem->fixed_translations.resize(problem->num_frames);
  problem->fixed_translations[frame] = at.translations[frame];
}

// Marks the points, or the frames, whose residuals are all below the bound
// where they are infinitely far away in some direction.
std::vector<char> FindFar(const KnownRotationProblem& problem, Kind kind,
                          Norm norm, double bound, const Context& context) {
  const bool is_of_points = kind == Kind::kPoints;
  const KnownRotationProblem directions = WithoutPositions(problem);
  Estimate estimate = MeanDirections(directions, kind);
  const int32_t count = is_of_points ? problem.num_points : problem.num_frames;
  std::vector<double> costs(count);
  const auto measure = [&] {
    for (int32_t n = 0; n < count; ++n) {
      costs[n] =
          is_of_points
              ? CostOf(directions, estimate, norm, directions.OfPoint(n))
              : CostOf(directions, estimate, norm, directions.OfFrame(n));
    }
  };
  measure();
  const auto is_undecided = [&](int64_t i) {
    const double cost = costs[is_of_points ? directions.observations[i].point
                                           : directions.FrameOf(i)];
    return cost >= bound && std::isfinite(cost);
  };
  const ProblemSubset part(
      directions,
      IndicesWhere(SignedSize(directions.observations), is_undecided));
  Estimate lowered = part.Restrict(estimate);
  BlockSweep sweep(part.problem(), FastDescentOptions(), norm, context);
  if (is_of_points) {
    sweep.IntersectPoints(&lowered);
  } else {
    sweep.ResectFrames(&lowered);
  }
  part.Replace(lowered, &estimate);
  measure();
  std::vector<char> is_far(count, 0);
  for (int32_t n = 0; n < count; ++n) {
    const bool is_fixed =
        is_of_points ? problem.IsFixedPoint(n) : problem.IsFixedFrame(n);
    is_far[n] = !is_fixed && costs[n] < bound;
  }
  return is_far;
}

}  // namespace

FarParts FindFarParts(const KnownRotationProblem& problem,
                      std::vector<int64_t> observations, Norm norm,
                      double bound, const Context& context) {
  FarParts far;
  far.points.assign(problem.num_points, 0);
  far.frames.assign(problem.num_frames, 0);
  for (;;) {
    const ProblemSubset part(problem, observations);
    const std::vector<char> points =
        FindFar(part.problem(), Kind::kPoints, norm, bound, context);
    const std::vector<char> frames =
        FindFar(part.problem(), Kind::kFrames, norm, bound, context);
    std::vector<int64_t> left;
    for (size_t n = 0; n < observations.size(); ++n) {
      const auto in_part = static_cast<int64_t>(n);
      const int64_t i = observations[n];
      const bool is_point_far = points[part.problem().observations[n].point];
      const bool is_frame_far = frames[part.problem().FrameOf(in_part)];
      if (is_point_far) far.points[problem.observations[i].point] = 1;
      if (is_frame_far) far.frames[problem.FrameOf(i)] = 1;
      if (!is_point_far && !is_frame_far) left.push_back(i);
    }
    if (left.size() == observations.size()) return far;
    observations = std::move(left);
  }
}

ToleranceGauge ChooseGauge(const KnownRotationProblem& problem,
                           const Estimate& estimate,
                           const std::vector<char>& is_far_frame) {
  std::vector<int64_t> counts(problem.views.size(), 0);
  for (const Observation& o : problem.observations) ++counts[o.view];
  ToleranceGauge gauge;
  const auto first = static_cast<int32_t>(
      std::max_element(counts.begin(), counts.end()) - counts.begin());
  gauge.first = {Pull::Kind::kView, first};
  if (HasBaseline(problem)) return gauge;
  const Components components = FindComponents(problem);
  const auto component = [&](int32_t v) {
    return components.of_frame[problem.views[v].frame];
  };
  const Vector3d at_first = CentreAt(problem, estimate, first);
  std::pair<bool, double> best = {false, 0};
  for (int32_t v = 0; v < static_cast<int32_t>(counts.size()); ++v) {
    if (counts[v] == 0 || component(v) != component(first)) continue;
    const double distance = (CentreAt(problem, estimate, v) - at_first).norm();
    const std::pair here = {!is_far_frame[problem.views[v].frame], distance};
    if (distance == 0 || here <= best) continue;
    best = here;
    gauge.second = {Pull::Kind::kView, v};
  }
  return gauge;
}

std::vector<int64_t> HeldObservations(const KnownRotationProblem& problem,
                                      std::vector<int64_t> observations) {
  std::vector<int64_t> held;
  for (const std::vector<int64_t>& component :
       SplitIntoComponents(problem, std::move(observations))) {
    if (!HasFixed(ProblemSubset(problem, component).problem())) continue;
    held.insert(held.end(), component.begin(), component.end());
  }
  std::sort(held.begin(), held.end());
  return held;
}

ToleranceProblem::ToleranceProblem(const Model& model, BuiltProblem* built,
                                   const Estimate& centre,
                                   const ToleranceGauge& gauge, Norm norm,
                                   double bound, const Context& context)
    : model_(model),
      built_(*built),
      centre_(centre),
      gauge_(gauge),
      norm_(norm),
      bound_(bound) {
  KnownRotationProblem& problem = built->problem;
  if (gauge.first) Fix(*gauge.first, centre, &problem);
  if (gauge.first && gauge.second && IsScaleFree(problem)) {
    scale_ = *gauge.second;
    scale_->direction = (PositionOf(problem, centre, *gauge.second) -
                         PositionOf(problem, centre, *gauge.first))
                            .normalized();
  }
  has_row_ =
      TakeOuterRows(model, *built, norm, bound, context.num_threads, &problem);
  // Rays beyond a lens's fold may project near a pixel, too, but rows hold the
  // ray of the pixel.
  for (size_t i = 0; i < has_row_.size(); ++i) {
    const ViewedPoint viewed =
        ViewPoint(problem, problem.observations[i], centre);
    if (!(ResidualOf(viewed, norm) < bound)) has_row_[i] = 0;
  }
  num_rowless_ = std::count(has_row_.begin(), has_row_.end(), char{0});
  far_ = FindFarParts(problem,
                      IndicesWhere(SignedSize(has_row_),
                                   [&](int64_t i) { return has_row_[i]; }),
                      norm, bound, context);
  num_far_points_ = std::count(far_.points.begin(), far_.points.end(), char{1});
}

std::optional<ProblemSubset> ToleranceProblem::UsablePart(
    const Pulls& targets) const {
  const KnownRotationProblem& whole = problem();
  FarParts far = far_;
  for (const Pulls& wanted : {targets, scale_ ? Pulls{*scale_} : Pulls{}}) {
    for (const Pull& pull : wanted) {
      if (pull.kind == Pull::Kind::kPoint) {
        far.points[pull.index] = 0;
      } else {
        far.frames[whole.views[pull.index].frame] = 0;
      }
    }
  }
  const auto is_usable = [&](int64_t i) {
    return has_row_[i] && !far.points[whole.observations[i].point] &&
           !far.frames[whole.FrameOf(i)];
  };
  ProblemSubset part(
      whole,
      HeldObservations(whole, IndicesWhere(SignedSize(has_row_), is_usable)));
  for (const Pull& target : targets) {
    if (!InPart(part, target) && !IsFixedPosition(whole, target)) {
      return std::nullopt;
    }
  }
  if (scale_ && !InPart(part, *scale_)) return std::nullopt;
  return std::optional<ProblemSubset>(std::move(part));
}

}  // namespace krot::internal
