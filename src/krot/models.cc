// The public functions from model to model: their options become those of the
// pipeline, and its summaries what they return.

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "krot/adjust.h"
#include "krot/base/write_file.h"
#include "krot/certificate.h"
#include "krot/convert/certificate_file.h"
#include "krot/outliers.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/solve.h"
#include "krot/tolerance/tolerance_analysis.h"
#include "krot/tolerances.h"

namespace krot {

using namespace internal;

namespace {

SolveModelOptions PipelineOptions(const SolveOptions& options) {
  SolveModelOptions pipeline;
  pipeline.method = options.method;
  pipeline.init = options.init;
  pipeline.init_max_error = options.init_max_error;
  pipeline.norm = options.norm;
  pipeline.joint.relative_gap = options.relative_gap;
  pipeline.joint.max_iterations = options.max_iterations;
  pipeline.problem.min_track_length = options.min_track_length;
  if (options.keep_closest_of_image) {
    pipeline.problem.same_image = SameImage::kClosest;
  }
  pipeline.problem.fixed = options.fixed;
  pipeline.problem.positions = options.positions;
  if (!options.finish_by_least_squares) {
    pipeline.finish.finish = Finish::kNone;
  }
  pipeline.finish.slack = options.finish_slack;
  pipeline.finish.max_error = options.finish_max_error;
  pipeline.describe_certificate = options.write_certificate;
  if (options.on_progress) {
    const auto tell = [told = std::make_shared<SolveState>(),
                       on_progress = options.on_progress](
                          std::optional<double> max_error,
                          std::optional<double> lower_bound) {
      if (max_error) told->max_error = max_error;
      if (lower_bound) told->lower_bound = lower_bound;
      on_progress(*told);
    };
    pipeline.res_int.callback = [tell](int, const Sweep& sweep) {
      tell(sweep.cost, std::nullopt);
    };
    pipeline.joint.callback = [tell](int, const JointIteration& state) {
      tell(state.cost, state.lower_bound);
    };
    pipeline.finish.callback = [tell](const BoundedIterate&) { tell({}, {}); };
  }
  return pipeline;
}

SolveResult Described(SolveModelResult solved) {
  const SolveSummary& summary = solved.summary;
  SolveResult result;
  static_cast<SolveFindings&>(result) = summary;
  result.model = std::move(solved.model);
  result.max_error = summary.cost_final;
  result.lowest_max_error = summary.LowestCost();
  result.errors_before = summary.pixel_error_before;
  result.errors_after = summary.pixel_error_after;
  result.loose_images = summary.loose.images;
  if (summary.certificate) {
    result.certificate = CertificateJson(*summary.certificate);
  }
  return result;
}

}  // namespace

SolveResult Solve(const Model& model, const SolveOptions& options,
                  const Context& context) {
  return Described(SolveModel(model, PipelineOptions(options), context));
}

SolveResult Triangulate(const Model& model, const SolveOptions& options,
                        const Context& context) {
  return Described(TriangulateModel(model, PipelineOptions(options), context));
}

AdjustResult Adjust(const Model& model, const AdjustOptions& options,
                    const Context& context) {
  AdjustModelOptions pipeline;
  pipeline.adjustment = options.adjustment;
  pipeline.max_error_factor = options.max_error_factor;
  AdjustModelResult adjusted = AdjustModel(model, pipeline, context);
  AdjustModelSummary& summary = adjusted.summary;
  return {std::move(adjusted.model), std::move(summary.adjustment),
          summary.max_error,         summary.pixel_error_before,
          summary.pixel_error_start, summary.pixel_error_after};
}

OutlierResult RemoveOutliers(const Model& model, const OutlierOptions& options,
                             const Context& context) {
  OutlierFilterOptions pipeline;
  pipeline.method = options.method;
  pipeline.max_error = options.max_error;
  pipeline.find_conflicts = options.find_conflicts;
  pipeline.make_profile = options.make_profile;
  pipeline.solve = PipelineOptions(options.solve);
  OutlierFilterResult filtered = FilterOutliers(model, pipeline, context);
  const OutlierFilterSummary& summary = filtered.summary;
  OutlierResult result;
  static_cast<OutlierFindings&>(result) = summary;
  result.model = std::move(filtered.model);
  result.errors_before = summary.pixel_error_before;
  result.errors_after = summary.pixel_error_after;
  if (summary.solve) {
    result.termination = summary.solve->termination;
    result.lower_bound = summary.solve->lower_bound;
  }
  if (summary.conflicts) result.conflicts = ConflictJson(*summary.conflicts);
  return result;
}

TolerancesResult FindTolerances(const Model& model,
                                const TolerancesOptions& options,
                                const Context& context) {
  ToleranceOptions pipeline;
  static_cast<ToleranceRequest&>(pipeline) = options;
  pipeline.solve = PipelineOptions(options.solve);
  ToleranceResult found = AnalyzeTolerances(model, pipeline, context);
  ToleranceSummary& summary = found.summary;
  return {std::move(found.model),
          summary.termination,
          summary.cost,
          summary.lower_bound,
          std::move(summary.gauge_images),
          std::move(summary.boxes)};
}

CertificateVerdict VerifyCertificate(const Model& model,
                                     const std::string& json) {
  return VerifyCertificateFile(model, ParseCertificate(json, "certificate"));
}

ConflictVerdict VerifyConflicts(const Model& model, const std::string& json) {
  return VerifyConflictFile(model, ParseConflicts(json, "conflicts"));
}

std::string ReadCertificate(const std::filesystem::path& path) {
  return ReadCertificateText(path);
}

void WriteCertificate(const std::string& json,
                      const std::filesystem::path& path) {
  WriteFileAtomically(path, json);
}

}  // namespace krot
