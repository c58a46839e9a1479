// The commands. Each takes a Model and keywords, which have the names of the
// command line, and returns the new Model and the command's report as JSON.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <pybind11/functional.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "krot/analysis/model_comparison.h"
#include "krot/base/context.h"
#include "krot/convert/certificate_file.h"
#include "krot/options/command_options.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/report/reports.h"
#include "krot/version.h"
#include "python/bindings.h"
#include "python/keywords.h"
#include "python/known_files.h"
#include "python/run.h"

namespace krot::internal {
namespace {

namespace py = pybind11;

using ModelPointer = std::shared_ptr<Model>;
using ConstModelPointer = std::shared_ptr<const Model>;

// Receives the stage, the largest error or None, and the lower bound or None.
using Progress = std::function<void(const std::string&, std::optional<double>,
                                    std::optional<double>)>;

// What a command returns; Python makes objects from the JSON texts.
struct Outcome {
  ModelPointer model;
  std::string report;
  std::optional<std::string> certificate;
};

OptionTable TableOf(const std::string& function) {
  return {function, "", "docs/cli.md"};
}

// Reports progress to Python. The callbacks take the GIL, which the call itself
// has released.
void Follow(const Progress& progress, SolveModelOptions* options) {
  if (!progress) return;
  options->res_int.callback = [progress](int, const Sweep& state) {
    const py::gil_scoped_acquire acquire;
    progress("sweeps", state.cost, std::nullopt);
  };
  options->joint.callback = [progress](int, const JointIteration& state) {
    const py::gil_scoped_acquire acquire;
    progress(state.target ? "start" : "joint", state.cost, state.lower_bound);
  };
  options->finish.callback = [progress](const BoundedIterate&) {
    const py::gil_scoped_acquire acquire;
    progress("finish", std::nullopt, std::nullopt);
  };
}

Outcome RunSolve(const ConstModelPointer& model, TolerantSolveOptions options,
                 Context context, const Progress& progress,
                 const std::string& command, const RunRecord& run,
                 const std::optional<PositionFrame>& position_frame = {},
                 bool writes_own_frame = false) {
  const Timer timer;
  Follow(progress, &options.solve);
  options.solve.describe_certificate = true;
  TolerantSolveResult result;
  RunInterruptibly([&](const CancelFlag& cancel) {
    context.cancel = &cancel;
    result = SolveTolerantly(*model, options, context);
  });
  SolveReport report;
  report.run = run;
  RecordEnd(timer, context.num_threads, &report.run);
  report.command = command;
  report.method = MethodName(result.summary.method);
  report.summary = std::move(result.summary);
  report.outliers = std::move(result.outliers);
  report.position_frame = position_frame;
  if (writes_own_frame) result.model = InPositionFrame(result.model, &report);
  Outcome outcome{std::make_shared<Model>(std::move(result.model)),
                  SolveJson(report), std::nullopt};
  if (report.summary.certificate) {
    outcome.certificate = CertificateJson(*report.summary.certificate);
  }
  return outcome;
}

Outcome SolveCommand(const ModelPointer& model, const Progress& progress,
                     const py::dict& keywords) {
  TolerantSolveOptions options;
  Context context;
  OptionTable table = TableOf("pykrot.solve");
  AddSolverOptions(&options, &context, &table);
  KnownFiles known;
  known.AddRotationsTo(&table);
  known.AddFixedTo(&table);
  known.AddPositionsTo(&table);
  AssignKeywords(keywords, &table);
  ResolveSolverOptions(table, &options.solve);
  RunRecord run;
  const ConstModelPointer input = known.WithRotations(model, &run);
  options.solve.problem.fixed = known.Fixed(*input);
  KnownPositions positions = known.Positions(*input);
  options.solve.problem.positions = std::move(positions.positions);
  options.has_other_rotations = run.rotations.has_value();
  return RunSolve(input, options, context, progress, "solver", run,
                  positions.frame, known.writes_own_frame());
}

Outcome TriangulateCommand(const ModelPointer& model, const Progress& progress,
                           const py::dict& keywords) {
  TolerantSolveOptions options;
  Context context;
  OptionTable table = TableOf("pykrot.triangulate");
  AddSolveOptions(&options.solve, &context, &table);
  AssignKeywords(keywords, &table);
  CheckSolveOptions(options.solve, table);
  options.solve = PointsOnly(options.solve);
  return RunSolve(model, options, context, progress, "point_triangulator", {});
}

Outcome FilterCommand(const ModelPointer& model, const Progress& progress,
                      const py::dict& keywords) {
  const Timer timer;
  OutlierFilterOptions options;
  Context context;
  OptionTable table = TableOf("pykrot.filter");
  AddOutlierFilterOptions(&options, &context, &table);
  KnownFiles known;
  known.AddRotationsTo(&table);
  AssignKeywords(keywords, &table);
  ResolveOutlierFilterOptions(table, false, &options);
  OutlierReport report;
  const ConstModelPointer input = known.WithRotations(model, &report.run);
  Follow(progress, &options.solve);
  OutlierFilterResult result;
  RunInterruptibly([&](const CancelFlag& cancel) {
    context.cancel = &cancel;
    result = FilterOutliers(*input, options, context);
  });
  RecordEnd(timer, context.num_threads, &report.run);
  report.summary = std::move(result.summary);
  Outcome outcome{std::make_shared<Model>(std::move(result.model)),
                  OutlierJson(report), std::nullopt};
  if (report.summary.conflicts) {
    outcome.certificate = ConflictJson(*report.summary.conflicts);
  }
  return outcome;
}

// Returns the cured model.
Outcome CheckModelCommand(const ModelPointer& model, const Progress&,
                          const py::dict& keywords) {
  const Timer timer;
  Context context;
  OptionTable table = TableOf("pykrot.check");
  table.AddThreads("num_threads", &context.num_threads,
                   "the result is the same, bit by bit");
  KnownFiles known;
  known.AddDatabaseTo(&table);
  AssignKeywords(keywords, &table);
  const std::optional<Database> database = known.Matches(*model);
  ModelCheckOptions options;
  if (database) options.database = &*database;
  CheckReport report;
  report.num_observations = static_cast<int64_t>(model->track_elements.size());
  Model cured;
  RunInterruptibly([&](const CancelFlag& cancel) {
    context.cancel = &cancel;
    report.check = CheckModel(*model, options, context);
    ModelCure cure = CureModel(*model, report.check, options, context);
    cured = std::move(cure.model);
    report.moved = std::move(cure.moved);
  });
  report.seconds_check = timer.Seconds();
  report.pixel_error_before = Summarize(PixelErrors(*model));
  report.pixel_error_after = Summarize(PixelErrors(cured));
  RecordEnd(timer, context.num_threads, &report.run);
  return {std::make_shared<Model>(std::move(cured)), CheckJson(report),
          std::nullopt};
}

Outcome AdjustCommand(const ModelPointer& model, const Progress& progress,
                      const py::dict& keywords) {
  const Timer timer;
  AdjustmentOptions given;
  OptionTable table = TableOf("pykrot.bundle_adjust");
  given.AddTo(&table);
  KnownFiles known;
  known.AddFixedTo(&table);
  known.AddPositionsTo(&table);
  known.AddDistancesTo(&table);
  AssignKeywords(keywords, &table);
  AdjustModelOptions options = given.Resolve(table);
  Model input = *model;
  options.adjustment.fixed = known.Fixed(input);
  const Survey survey(known.Positions(input), known.writes_own_frame(), &input);
  options.adjustment.positions = survey.positions();
  const DistanceSurvey distances(
      known.Distances(input),
      options.adjustment.fixed.Any() ? 1 : survey.scale(), &input);
  options.adjustment.distances = distances.distances();
  Follow(progress, &options.start);
  AdjustModelResult result;
  RunInterruptibly([&](const CancelFlag& cancel) {
    result = AdjustModel(input, options, {given.num_threads(), &cancel});
  });
  AdjustmentReport report;
  RecordEnd(timer, given.num_threads(), &report.run);
  report.summary = std::move(result.summary);
  report.positions = survey.ComparePositions(result.model);
  report.position_frame = survey.frame();
  report.is_in_position_frame = survey.is_in_own_frame();
  report.distances = distances.Compare(result.model, report.summary);
  std::string json = AdjustmentJson(report, result.model);
  return {std::make_shared<Model>(std::move(result.model)), std::move(json),
          std::nullopt};
}

Outcome ToleranceCommand(const ModelPointer& model, const Progress& progress,
                         const py::dict& keywords) {
  const Timer timer;
  ToleranceArguments arguments;
  Context context;
  OptionTable table = TableOf("pykrot.tolerances");
  AddToleranceOptions(&arguments, &context, &table);
  KnownFiles known;
  known.AddRotationsTo(&table);
  known.AddFixedTo(&table);
  AssignKeywords(keywords, &table);
  ToleranceReport report;
  const ConstModelPointer input = known.WithRotations(model, &report.run);
  ToleranceOptions options = ResolveToleranceOptions(arguments, *input);
  options.solve.problem.fixed = known.Fixed(*input);
  Follow(progress, &options.solve);
  ToleranceResult result;
  RunInterruptibly([&](const CancelFlag& cancel) {
    context.cancel = &cancel;
    result = AnalyzeTolerances(*input, options, context);
    report.pixel_error_before =
        Summarize(PixelErrors(*input, context.num_threads));
    report.pixel_error_after =
        Summarize(PixelErrors(result.model, context.num_threads));
  });
  RecordEnd(timer, context.num_threads, &report.run);
  report.summary = std::move(result.summary);
  return {std::make_shared<Model>(std::move(result.model)),
          ToleranceJson(report), std::nullopt};
}

// The report as JSON; none if the models share too little to be aligned.
std::optional<std::string> CompareCommand(const ModelPointer& model1,
                                          const ModelPointer& model2,
                                          const std::string& alignment,
                                          int num_worst) {
  CompareModelsOptions options;
  OptionTable table = TableOf("pykrot.compare");
  table.AddNamed<AlignmentKind>("alignment", &options.alignment,
                                {{"frame", AlignmentKind::kFrame},
                                 {"similarity", AlignmentKind::kSimilarity},
                                 {"none", AlignmentKind::kNone}},
                                "");
  table.AddInteger("num_worst", &options.num_worst, AtLeast(0), "");
  table.Assign({{"alignment", alignment, "alignment"},
                {"num_worst", std::to_string(num_worst), "num_worst"}});
  std::optional<ComparisonSummary> summary;
  RunInterruptibly([&](const CancelFlag&) {
    const ModelCorrespondence shared = FindCorrespondence(*model1, *model2);
    if (shared.images.empty()) return;
    summary = CompareModels(*model1, *model2, shared, options);
  });
  if (!summary) return std::nullopt;
  ComparisonReport report;
  report.version = KROT_VERSION;
  report.summary = std::move(*summary);
  return ComparisonJson(report);
}

// Returns (is accepted, refusal, proved pixels or None, proved removals or
// None).
py::tuple CheckProof(const ModelPointer& model, const std::string& json) {
  if (HoldsConflicts(json)) {
    ConflictVerdict verdict;
    const ConflictFile file = ParseConflicts(json, "the conflicts");
    RunInterruptibly(
        [&](const CancelFlag&) { verdict = VerifyConflictFile(*model, file); });
    return py::make_tuple(verdict.is_accepted, verdict.refusal,
                          verdict.max_error, verdict.num_conflicts);
  }
  CertificateVerdict verdict;
  const CertificateFile file = ParseCertificate(json, "the certificate");
  RunInterruptibly([&](const CancelFlag&) {
    verdict = VerifyCertificateFile(*model, file);
  });
  return py::make_tuple(verdict.is_accepted, verdict.refusal,
                        verdict.lower_bound, py::none());
}

}  // namespace

void BindCommands(py::module_* module) {
  py::class_<Outcome>(*module, "Outcome")
      .def_readonly("model", &Outcome::model)
      .def_readonly("report", &Outcome::report)
      .def_readonly("certificate", &Outcome::certificate);
  const auto define = [&](const char* name, const auto& command) {
    module->def(name, command, py::arg("model"), py::arg("progress"),
                py::arg("options"));
  };
  define("solve", &SolveCommand);
  define("triangulate", &TriangulateCommand);
  define("filter", &FilterCommand);
  define("check", &CheckModelCommand);
  define("bundle_adjust", &AdjustCommand);
  define("tolerances", &ToleranceCommand);
  module->def("compare", &CompareCommand, py::arg("model1"), py::arg("model2"),
              py::arg("alignment"), py::arg("num_worst"));
  module->def("check_certificate", &CheckProof, py::arg("model"),
              py::arg("certificate"));
}

}  // namespace krot::internal
