#include "krot/pipeline/adjust_model.h"

#include <cmath>
#include <sstream>
#include <utility>
#include <vector>

#include "krot/analysis/model_input.h"
#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/check.h"
#include "krot/model/derived_models.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "krot/pipeline/stages.h"

namespace krot::internal {
namespace {

// Looks at the errors of all observations, so that the errors that COLMAP
// recomputes are below the cap, too.
bool IsBelow(const PixelErrorStatistics& errors, double max_error) {
  return errors.not_finite == 0 && errors.max < max_error;
}

std::string PixelText(double error_px) {
  std::ostringstream text;
  text.precision(6);
  text << error_px << " px";
  return text.str();
}

// Puts the course of earlier adjustments before that of the last one.
void AddEarlier(BundleAdjustmentSummary earlier,
                BundleAdjustmentSummary* last) {
  if (earlier.iterations.empty()) return;
  for (const BundleAdjustmentIteration& iteration : last->iterations) {
    earlier.iterations.push_back(iteration);
    earlier.iterations.back().iteration += earlier.num_iterations;
    earlier.iterations.back().seconds += earlier.seconds;
  }
  last->iterations = std::move(earlier.iterations);
  last->num_iterations += earlier.num_iterations;
  last->seconds += earlier.seconds;
  last->cost_initial = earlier.cost_initial;
}

// The model from which a bounded adjustment starts; none if no estimate below
// the cap was found. Sets the cap, summary->max_error.
std::optional<Model> BoundedStart(const Model& model,
                                  const AdjustModelOptions& options,
                                  const Context& context,
                                  AdjustModelSummary* summary) {
  summary->max_error = options.adjustment.max_error;
  const bool is_given = summary->max_error && !options.max_error_factor;
  if (is_given && IsBelow(summary->pixel_error_before, *summary->max_error)) {
    return model;
  }
  context.Note(!is_given
                   ? "the cap refers to the lowest maximum with these "
                     "rotations: solving for it"
                   : "the model's largest error is not below the cap: solving "
                     "for the lowest with these rotations");
  SolveModelOptions lowest = options.start;
  lowest.finish.finish = Finish::kNone;
  lowest.problem.fixed = options.adjustment.fixed;
  SolveModelResult start = SolveModel(model, lowest, context);
  summary->pixel_error_start = start.summary.pixel_error_after;
  summary->start = std::move(start.summary);
  if (options.max_error_factor) {
    summary->max_error =
        *options.max_error_factor * summary->pixel_error_start.max;
  }
  if (context.IsCancelled() ||
      !IsBelow(summary->pixel_error_start,
               summary->max_error.value_or(kInfinity))) {
    return std::nullopt;
  }
  context.Note("largest error " + PixelText(summary->pixel_error_start.max) +
               (summary->max_error ? ", cap " + PixelText(*summary->max_error)
                                   : ", to be lowered with all that moves"));
  return std::move(start.model);
}

// Finds the noise beside which known positions and distances weigh,
// adjustment->sigma_px: that of the model that is adjusted with the positions.
// Returns this model, and the course so far, whose iterations are taken off
// what is allowed.
Model WeighKnown(const Model& model, const Context& context,
                 BundleAdjustmentOptions* adjustment,
                 BundleAdjustmentSummary* course) {
  constexpr int kMaxRounds = 5;
  constexpr double kSame = 0.02;  // of sigma
  const auto noise_of = [&](const Model& of) {
    return EstimateNoise(of, {}, context).sigma_px.value_or(1);
  };
  const int max_rounds = adjustment->positions.empty() ? 1 : kMaxRounds;
  const bool finds_noise = !adjustment->sigma_px;
  if (finds_noise) adjustment->sigma_px = noise_of(model);
  BundleAdjustmentOptions without_distances = *adjustment;
  without_distances.distances.clear();
  Model adjusted = model;
  for (int round = 0; round < max_rounds; ++round) {
    without_distances.sigma_px = adjustment->sigma_px;
    without_distances.max_num_iterations = adjustment->max_num_iterations;
    BundleAdjustmentResult result =
        AdjustBundle(adjusted, without_distances, context);
    adjusted = std::move(result.model);
    adjustment->max_num_iterations -= result.summary.num_iterations;
    AddEarlier(std::move(*course), &result.summary);
    *course = std::move(result.summary);
    if (context.IsCancelled() || adjustment->max_num_iterations <= 0) break;
    if (!finds_noise) break;
    const double before = *adjustment->sigma_px;
    adjustment->sigma_px = noise_of(adjusted);
    if (std::abs(*adjustment->sigma_px - before) <= kSame * before) break;
  }
  return adjusted;
}

// Finds the distances that contradict the model, or each other where they alone
// give it a scale: by more than the tolerance and three standard deviations of
// the length in a model that is adjusted without them. Where these are unknown
// the tolerance alone decides, and a length that is not determined contradicts
// nothing. Wrong lengths count as unknown from then on.
std::vector<char> LeaveOutWrongDistances(const Model& model,
                                         const Context& context,
                                         BundleAdjustmentOptions* adjustment) {
  std::vector<char> is_wrong(adjustment->distances.size(), 0);
  if (context.IsCancelled()) return is_wrong;
  BundleAdjustmentOptions of_lengths = *adjustment;
  of_lengths.max_num_iterations = 0;
  of_lengths.callback = {};
  for (KnownDistance& distance : of_lengths.distances) distance.metres.reset();
  std::optional<AdjustmentPrecision> precision;
  AdjustBundle(model, of_lengths, context, AdjustmentDatum::kCameras,
               &precision);
  if (precision) {
    for (const DistancePrecision& of : precision->distances) {
      KnownDistance& distance = of_lengths.distances[of.distance];
      const KnownDistance& known = adjustment->distances[of.distance];
      if (of.sigma == kInfinity) continue;
      distance.metres = known.metres;
      distance.tolerance =
          std::isnan(of.sigma)
              ? known.tolerance
              : std::hypot(known.tolerance, kRegionSigmas * of.sigma);
    }
  }
  const bool has_scale =
      adjustment->fixed.Any() || !adjustment->positions.empty();
  const MeasuredDistances measured =
      MeasureDistances(model, of_lengths.distances,
                       has_scale ? std::optional<double>(1) : std::nullopt);
  if (!measured.scale) return is_wrong;
  RequireOneScale("distances", of_lengths.distances.size(), *measured.scale);
  for (size_t n = 0; n < is_wrong.size(); ++n) {
    if (!of_lengths.distances[n].metres || measured.scale->agrees[n] != 0) {
      continue;
    }
    is_wrong[n] = 1;
    adjustment->distances[n].metres.reset();
  }
  return is_wrong;
}

// AdjustModel in the coordinates of the model.
AdjustModelResult AdjustInFrame(const Model& model,
                                const AdjustModelOptions& options,
                                const Context& context) {
  AdjustModelResult result;
  AdjustModelSummary& summary = result.summary;
  summary.pixel_error_before =
      Summarize(PixelErrors(model, context.num_threads));
  summary.pixel_error_start = summary.pixel_error_before;
  summary.pixel_error_after = summary.pixel_error_before;

  BundleAdjustmentOptions adjustment = options.adjustment;
  const bool is_bounded = adjustment.IsBounded() || options.max_error_factor;
  std::optional<Model> start;
  if (is_bounded) {
    start = BoundedStart(model, options, context, &summary);
    if (!start) {
      // Says whether there is nothing to adjust at all.
      adjustment = {};
      adjustment.max_num_iterations = 0;
      adjustment.min_track_length = options.adjustment.min_track_length;
      summary.adjustment = AdjustBundle(model, adjustment, context).summary;
      if (summary.adjustment.num_observations > 0) {
        summary.adjustment.termination =
            context.IsCancelled()
                ? BundleAdjustmentTermination::kInterrupted
                : BundleAdjustmentTermination::kInfeasibleStart;
      }
      result.model = model;
      return result;
    }
    adjustment.max_error = summary.max_error;  // none if it is to be lowered
  }
  BundleAdjustmentSummary earlier;
  const bool has_distances = !adjustment.distances.empty();
  if (has_distances ||
      (!adjustment.positions.empty() && !adjustment.sigma_px)) {
    start = WeighKnown(model, context, &adjustment, &earlier);
  }
  if (has_distances) {
    summary.is_wrong_distance =
        LeaveOutWrongDistances(*start, context, &adjustment);
  }
  BundleAdjustmentResult adjusted =
      AdjustBundle(start ? *start : model, adjustment, context, options.datum,
                   options.finds_precision ? &summary.precision : nullptr);
  summary.adjustment = std::move(adjusted.summary);
  AddEarlier(std::move(earlier), &summary.adjustment);
  summary.max_error = summary.adjustment.max_error;
  result.model = std::move(adjusted.model);
  const std::vector<double> errors_px =
      PixelErrors(result.model, context.num_threads);
  UpdatePointErrors(errors_px, &result.model);
  summary.pixel_error_after = Summarize(errors_px);
  return result;
}

}  // namespace

FixedPositions CheckFixedPositions(
    const Model& model, const FixedParts& fixed,
    const std::vector<KnownPosition>& positions) {
  FixedPositions found;
  if (!fixed.Any() || positions.empty()) return found;
  const auto text = [](const Eigen::Vector3d& x) {
    std::ostringstream numbers;
    numbers.precision(9);
    numbers << x.transpose();
    return numbers.str();
  };
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  for (const KnownPosition& position : positions) {
    const auto place = PlaceOf(model, images, position);
    const bool is_fixed =
        position.of == KnownPosition::Of::kPoint3D
            ? fixed.HasPoint(position.index)
            : place && fixed.HasFrame(images[position.index].frame);
    if (!is_fixed) continue;
    const Ellipsoid& region = position.region;
    const double ratio =
        (region.UnitFromWorld() * (*place - region.centre)).norm();
    if (!(ratio <= 1 + kKeptPosition)) {
      throw ModelError(
          "found " + NameOf(model, position) + " fixed at " + text(*place) +
          ", expected it within the radius around " + text(region.centre) +
          ", its known position; let it move, or correct that");
    }
    ++found.count;
    found.largest_ratio = std::max(found.largest_ratio, ratio);
  }
  return found;
}

AdjustModelResult AdjustModel(const Model& model,
                              const AdjustModelOptions& options,
                              const Context& context) {
  if (options.max_error_factor) {
    CheckArgument(*options.max_error_factor > 1, "max_error_factor",
                  *options.max_error_factor, "> 1");
  }
  const BundleAdjustmentOptions& known = options.adjustment;
  CheckFixedPositions(model, known.fixed, known.positions);
  const LocalFrame frame(model, known.fixed, known.positions);
  AdjustModelOptions local_options = options;
  local_options.adjustment.positions = frame.ToLocal(known.positions);
  AdjustModelResult result =
      InLocalFrame(frame, model, [&](const Model& local) {
        return AdjustInFrame(local, local_options, context);
      });
  if (frame.IsModels()) return result;
  // The way back from the local frame rounds.
  const std::vector<double> errors_px =
      PixelErrors(result.model, context.num_threads);
  UpdatePointErrors(errors_px, &result.model);
  result.summary.pixel_error_after = Summarize(errors_px);
  return result;
}

}  // namespace krot::internal
