#include "krot/pipeline/solve_model.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/joint/joint.h"
#include "krot/linear/reduced_camera_system.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"
#include "krot/pipeline/stages.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

int64_t Size(size_t count, size_t bytes) {
  return static_cast<int64_t>(count * bytes);
}

int64_t ModelBytes(const Model& model) {
  int64_t bytes = Size(model.images.size(), sizeof(Image)) +
                  Size(model.points3D.size(), sizeof(Point3D)) +
                  Size(model.track_elements.size(), sizeof(TrackElement));
  for (const Image& image : model.images) {
    bytes += Size(image.points2D.size(), sizeof(Point2D));
  }
  return bytes;
}

// Bytes of the observations with two indices to each, and of the views, points
// and frames.
int64_t ProblemBytes(const KnownRotationProblem& problem) {
  return Size(problem.observations.size(), sizeof(Observation) + 8) +
         Size(problem.views.size(), sizeof(View)) +
         8 * (int64_t{problem.num_points} + problem.num_frames);
}

int64_t EstimateBytes(const KnownRotationProblem& problem) {
  return 24 * (int64_t{problem.num_points} + problem.num_frames);
}

// Bytes of a subset of a problem: a problem of its own, and the indices of its
// observations.
int64_t PartBytes(const KnownRotationProblem& problem) {
  return ProblemBytes(problem) + Size(problem.observations.size(), 8);
}

// The first working set of the joint solver, as a problem.
ProblemSubset FirstWorkingProblem(const BuiltProblem& built, Norm norm,
                                  const Context& context) {
  const KnownRotationProblem& problem = built.problem;
  const double cost = Cost(problem, built.start, norm, context.num_threads);
  const WorkingSet set =
      FirstWorkingSet(problem, built.start, norm, cost, context);
  return ProblemSubset(problem, set.Observations());
}

// Bytes of an interior point on this problem: a constant for each observation,
// and the reduced camera system.
int64_t InteriorPointBytes(const KnownRotationProblem& problem,
                           size_t bytes_per_observation) {
  return Size(problem.observations.size(), bytes_per_observation) +
         ReducedCameraSystem(AnchoredStructure(problem)).MemoryBytes();
}

}  // namespace

int64_t EstimateSolveMemory(const Model& model, const BuiltProblem& built,
                            const SolveSummary& summary,
                            const Context& context) {
  // Bytes per observation, counted in the code of the joint solver.
  constexpr size_t kJointBytes = 600;
  const KnownRotationProblem& problem = built.problem;
  // Code and libraries; the start, the estimate, and the copies that sweeps and
  // iterations compare.
  const int64_t held = 14000000 + ModelBytes(model) + ProblemBytes(problem) +
                       5 * EstimateBytes(problem);
  // Bytes per point and per frame.
  const int64_t sweeps =
      200 * (int64_t{problem.num_points} + problem.num_frames);
  // In the end: the model that is returned, and the pixel errors.
  const int64_t result =
      ModelBytes(model) + Size(model.track_elements.size(), 2 * sizeof(double));
  int64_t most = std::max(sweeps, result);
  // Which observation is in which component and working set, and a copy of the
  // largest component unless there is only one.
  const int64_t component =
      Size(problem.observations.size(), 16) +
      (summary.num_components > 1 ? PartBytes(problem) : 0);
  if (summary.init == SolveInit::kFeasible) {
    most = std::max(most, component + InteriorPointBytes(problem, kJointBytes));
  } else if (summary.method != SolveMethod::kResInt) {
    // Sweeps, which place the points outside the working set, hold their memory
    // at the same time as the interior point.
    const ProblemSubset working =
        FirstWorkingProblem(built, summary.norm, context);
    most =
        std::max(most, component + PartBytes(working.problem()) + sweeps +
                           InteriorPointBytes(working.problem(), kJointBytes));
    if (summary.method == SolveMethod::kAuto) {
      most = std::max(most, InteriorPointBytes(problem, 300));
    }
  }
  // The allocator holds more memory than is in use.
  return static_cast<int64_t>(1.05 * static_cast<double>(held + most));
}

namespace {

// Replaces the fixed positions of a certificate, which are in the local frame,
// by those of the model, to the bit.
void PlaceFixed(const Model& model, CertificateFile* certificate) {
  if (!certificate->fixed_images.empty()) {
    const std::vector<ImageGeometry> geometries = ImageGeometries(model);
    const IdIndex<ImageId> images(model.images);
    for (CertificateFile::FixedImage& fixed : certificate->fixed_images) {
      const int32_t frame = geometries[*images.Find(fixed.image_id)].frame;
      fixed.translation = model.frames[frame].rig_from_world.translation;
    }
  }
  const IdIndex<Point3DId> points(model.points3D);
  for (CertificateFile::FixedPoint& fixed : certificate->fixed_points) {
    fixed.xyz = model.points3D[*points.Find(fixed.point3D_id)].xyz;
  }
}

// The same for the regions of known positions.
void PlaceKnown(const Model& model, const std::vector<KnownPosition>& known,
                CertificateFile* certificate) {
  for (CertificateFile::Position& position : certificate->positions) {
    for (const KnownPosition& k : known) {
      const bool is_images = k.of == KnownPosition::Of::kImage;
      const uint64_t id =
          is_images ? model.images[k.index].id : model.points3D[k.index].id;
      if (k.of == position.of && id == position.id) position.region = k.region;
    }
  }
}

}  // namespace

SolveMethod EffectiveMethod(const SolveModelOptions& options) {
  if (options.method != SolveMethod::kAuto) return options.method;
  const bool as_in_paper =
      options.res_int.fast_descent.settings == FastDescentSettings::kPaper;
  return as_in_paper || !HasJointSolver(options.norm) ? SolveMethod::kResInt
                                                      : SolveMethod::kAuto;
}

namespace {

// The bracket of the factor is narrow enough at this width, relative.
constexpr double kBracketWidth = 1e-3;
// A factor is tried beside the place where the root is expected, by this share
// of kBracketWidth, so that it cuts off the longer part of the bracket.
constexpr double kBeside = 0.3;

// Brackets the smallest factor at which the lowest maximum is at most the bound
// asked for. All in logarithms: x is that of the factor, y that of the lowest
// maximum over the bound asked for, so that y = 0 is searched.
class FactorBracket {
 public:
  double lowest() const { return lowest_; }
  double highest() const { return highest_; }
  bool IsClosed() const { return highest_ - lowest_ <= kBracketWidth; }

  // Adds a solve at `x` that proved `bound` and reached `cost`.
  void Add(double x, double bound, double cost) {
    if (cost <= 0) {
      highest_ = std::min(highest_, x);
    } else if (bound > 0) {
      lowest_ = std::max(lowest_, x);
    } else {
      open_.push_back(x);
    }
    const double y = std::isfinite(cost) ? cost : bound;
    if (!std::isfinite(y)) return;
    if (last_ && (y < last_->second) == (x > last_->first)) {
      slope_ = (y - last_->second) / (x - last_->first);
    }
    last_ = {x, y};
  }

  // Where to solve next; none if another solve would not narrow the bracket.
  std::optional<double> Next() const {
    if (IsClosed()) return std::nullopt;
    if (!open_.empty()) return BesideOpen();
    if (!last_) return std::nullopt;
    const auto& [x, y] = *last_;
    if (!std::isfinite(highest_)) {
      const double step =
          slope_ < 0 ? -y / slope_ + kBeside * kBracketWidth : std::log(2);
      return x + std::clamp(step, kBracketWidth, std::log(16));
    }
    const double width = highest_ - lowest_;
    if (!(slope_ < 0)) return lowest_ + width / 2;
    const double root = x - y / slope_;
    const double shift = root - lowest_ > highest_ - root ? -kBeside : kBeside;
    return std::clamp(root + shift * kBracketWidth, lowest_ + width / 20,
                      highest_ - width / 20);
  }

 private:
  // Where solves were undecided: halfway from them to the nearest place where
  // the answer is known.
  std::optional<double> BesideOpen() const {
    const auto [first, last] = std::minmax_element(open_.begin(), open_.end());
    const double below = *first - lowest_;
    const double above = std::min(highest_ - *last, std::log(2));
    if (std::max(below, above) <= kBracketWidth / 2) return std::nullopt;
    return below > above ? *first - below / 2 : *last + above / 2;
  }

  double lowest_ = 0;
  double highest_ = kInfinity;
  double slope_ = 0;
  std::optional<std::pair<double, double>> last_;
  std::vector<double> open_;
};

bool HasEstimate(const SolveSummary& summary) {
  return summary.termination != SolveTermination::kInfeasible &&
         summary.termination != SolveTermination::kNoStart &&
         summary.largest_position_ratio <= 1 + kKeptPosition;
}

class PositionInflater {
 public:
  PositionInflater(const SolveModelOptions& options, const Context& context)
      : options_(options),
        context_(context),
        max_error_(*options.inflate_positions_to),
        on_the_way_(options) {
    on_the_way_.inflate_positions_to.reset();
    on_the_way_.describe_certificate = true;
    on_the_way_.finish.finish = Finish::kNone;
    // The smaller the gap is, the fewer factors near the root stay undecided.
    on_the_way_.joint.relative_gap = std::min(2e-4, options.joint.relative_gap);
    on_the_way_.init_max_error = std::max(options.init_max_error, max_error_);
  }

  SolveModelResult Run(const Model& model) {
    std::optional<double> x = 0;
    for (int n = 0; n < 30 && x && *x <= std::log(1e6); ++n) {
      if (!Try(model, *x)) break;
      x = bracket_.Next();
    }
    return Result();
  }

 private:
  SolveModelOptions WithFactor(SolveModelOptions options, double x) const {
    for (KnownPosition& position : options.problem.positions) {
      position.region.semi_axes *= std::exp(x);
    }
    return options;
  }

  // False if interrupted.
  bool Try(const Model& model, double x) {
    const bool is_first = !first_;
    SolveModelResult result =
        SolveModel(last_.model.images.empty() ? model : last_.model,
                   WithFactor(on_the_way_, x), context_);
    if (is_first) first_ = result.summary;
    on_the_way_.on_built = nullptr;
    if (context_.IsCancelled()) {
      if (is_first) last_ = std::move(result);
      return false;
    }
    const SolveSummary& summary = result.summary;
    const bool has_estimate = HasEstimate(summary);
    const double bound = summary.lower_bound.value_or(0);
    const double cost = has_estimate ? summary.cost_final : kInfinity;
    bracket_.Add(x, std::log(bound / max_error_), std::log(cost / max_error_));
    if (bound > max_error_ && x == bracket_.lowest()) {
      refutation_ = summary.certificate;
    }
    if (has_estimate) on_the_way_.init = SolveInit::kModel;
    if (x == bracket_.highest() || !std::isfinite(bracket_.highest())) {
      last_ = std::move(result);
    }
    return true;
  }

  // The result of the bracket's upper end, with a finish; the last result if no
  // upper end was found.
  SolveModelResult Result() {
    if (context_.IsCancelled()) return std::move(last_);
    if (!std::isfinite(bracket_.highest())) {
      last_.summary.termination =
          last_.summary.lower_bound.value_or(0) > max_error_
              ? SolveTermination::kInfeasible
              : SolveTermination::kNoStart;
      return std::move(last_);
    }
    SolveModelOptions finished = on_the_way_;
    finished.describe_certificate = options_.describe_certificate;
    finished.finish = options_.finish;
    finished.finish.max_error = max_error_;
    SolveModelResult result = SolveModel(
        last_.model, WithFactor(finished, bracket_.highest()), context_);
    SolveSummary& summary = result.summary;
    summary.init = first_->init;
    summary.cost_initial = first_->cost_initial;
    summary.pixel_error_before = first_->pixel_error_before;
    summary.position_factor = {std::exp(bracket_.highest()),
                               std::exp(bracket_.lowest()), max_error_,
                               std::move(refutation_)};
    return result;
  }

  const SolveModelOptions& options_;
  const Context& context_;
  const double max_error_;
  SolveModelOptions on_the_way_;
  FactorBracket bracket_;
  std::optional<SolveSummary> first_;
  // The result of the bracket's upper end or, without one, of the last solve.
  SolveModelResult last_;
  std::optional<CertificateFile> refutation_;
};

// SolveModel with all radii of options.problem.positions times the smallest
// factor, at least 1, at which the largest error can be at most
// options.inflate_positions_to, pixels. The lowest maximum falls as radii grow.
// So solves that reach this error bracket the factor from above, and solves
// with a lower bound above it prove that the factor must be larger. The result
// is that of the bracket's upper end; if even the largest factor tried is
// refuted, it is the input with that proof (kInfeasible). Takes some ten
// solves, each from the last one's estimate.
SolveModelResult SolveWithInflatedPositions(const Model& model,
                                            const SolveModelOptions& options,
                                            const Context& context) {
  CheckArgument(*options.inflate_positions_to > 0, "inflate_positions_to",
                *options.inflate_positions_to, "> 0");
  CheckArgument(!options.problem.positions.empty(), "problem.positions", "none",
                "some with inflate_positions_to");
  return PositionInflater(options, context).Run(model);
}

}  // namespace

SolveModelResult SolveModel(const Model& model,
                            const SolveModelOptions& options,
                            const Context& context) {
  if (options.inflate_positions_to) {
    return SolveWithInflatedPositions(model, options, context);
  }
  const BuildProblemOptions& known = options.problem;
  const FixedPositions fixed =
      CheckFixedPositions(model, known.fixed, known.positions);
  const LocalFrame frame(model, known.fixed, known.positions);
  SolveModelOptions local_options = options;
  local_options.problem.positions = frame.ToLocal(known.positions);
  SolveModelResult result = InLocalFrame(frame, model, [&](const Model& local) {
    return SolveInFrame(local, local_options, context);
  });
  SolveSummary& summary = result.summary;
  summary.num_positions += fixed.count;
  summary.largest_position_ratio =
      std::max(summary.largest_position_ratio, fixed.largest_ratio);
  if (summary.certificate) {
    PlaceFixed(model, &*summary.certificate);
    PlaceKnown(model, known.positions, &*summary.certificate);
  }
  return result;
}

SolveModelResult TriangulateModel(const Model& model,
                                  const SolveModelOptions& options,
                                  const Context& context) {
  return SolveModel(model, PointsOnly(options), context);
}

SolveModelOptions PointsOnly(SolveModelOptions options) {
  options.method = SolveMethod::kResInt;
  options.init = SolveInit::kModel;
  options.polish = Polish::kNone;
  options.res_int.update_frames = false;
  options.res_int.max_sweeps = 1;
  return options;
}

}  // namespace krot::internal
