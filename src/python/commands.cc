// The commands. Each takes a Model and keywords, which have the names of the
// command line, and returns the new Model and the command's report as JSON.

#include <chrono>
#include <functional>
#include <future>
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
#include "python/keywords.h"

namespace krot::internal {
namespace {

namespace py = pybind11;

using ModelPointer = std::shared_ptr<Model>;

// Receives the stage, the largest error or None, and the lower bound or None.
using Progress = std::function<void(const std::string&, std::optional<double>,
                                    std::optional<double>)>;

// What a command returns; Python makes objects from the JSON texts.
struct Outcome {
  ModelPointer model;
  std::string report;
  std::optional<std::string> certificate;
};

// How often Python's signal handlers are called.
constexpr std::chrono::milliseconds kBetweenLooks(50);

// Runs `work` on a thread of its own with the GIL released, and watches for
// Ctrl-C. On Ctrl-C it cancels the work, waits until it ends, and throws what
// the signal raises. Rethrows exceptions of `work`. The caller must hold the
// GIL, and holds it again at the end.
void RunInterruptibly(const std::function<void(const CancelFlag&)>& work) {
  CancelFlag cancel(false);
  std::future<void> done =
      std::async(std::launch::async, [&] { work(cancel); });
  bool is_interrupted = false;
  for (;;) {
    {
      const py::gil_scoped_release release;
      if (done.wait_for(kBetweenLooks) == std::future_status::ready) break;
    }
    if (!is_interrupted && PyErr_CheckSignals() != 0) {
      is_interrupted = true;
      cancel = true;
      // The error is kept until the work has ended, because its callbacks may
      // need Python.
      const py::error_already_set error;
      {
        const py::gil_scoped_release release;
        done.wait();
      }
      throw error;
    }
  }
  done.get();
}

// A command as it runs: its keywords and options, what it finds out, and how
// long it takes.
struct Command {
  explicit Command(const std::string& function)
      : table(function, "", "docs/cli.md") {}

  // Runs `work`, which Ctrl-C ends, and records its end.
  template <typename Work>
  void Run(const Work& work) {
    RunInterruptibly([&](const CancelFlag& cancel) {
      context.cancel = &cancel;
      work();
    });
    RecordEnd(timer, context.num_threads, &run);
  }

  const Timer timer;
  OptionTable table;
  Context context;
  KnownFiles known;
  RunRecord run;
};

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

Outcome OutcomeOf(Model model, std::string report,
                  std::optional<std::string> certificate = {}) {
  return {std::make_shared<Model>(std::move(model)), std::move(report),
          std::move(certificate)};
}

Outcome RunSolve(Command* command, const Model& model,
                 TolerantSolveOptions options, const Progress& progress,
                 SolveReport report) {
  Follow(progress, &options.solve);
  options.solve.describe_certificate = true;
  TolerantSolveResult result;
  command->Run(
      [&] { result = SolveTolerantly(model, options, command->context); });
  report.run = command->run;
  report.method = MethodName(result.summary.method);
  report.summary = std::move(result.summary);
  report.outliers = std::move(result.outliers);
  if (report.position_frame && command->known.writes_own_frame()) {
    result.model = InPositionFrame(result.model, &report);
  }
  std::optional<std::string> certificate;
  if (report.summary.certificate) {
    certificate = CertificateJson(*report.summary.certificate);
  }
  return OutcomeOf(std::move(result.model), SolveJson(report),
                   std::move(certificate));
}

Outcome SolveCommand(const ModelPointer& model, const Progress& progress,
                     const py::dict& keywords) {
  Command command("pykrot.solve");
  TolerantSolveOptions options;
  AddSolverOptions(&options, &command.context, &command.table);
  command.known.AddRotationsTo(&command.table);
  command.known.AddFixedTo(&command.table);
  command.known.AddPositionsTo(&command.table);
  AssignKeywords(keywords, &command.table);
  ResolveSolverOptions(command.table, &options.solve);
  const auto input = command.known.WithRotations(model, &command.run);
  options.solve.problem.fixed = command.known.Fixed(*input);
  KnownPositions positions = command.known.Positions(*input);
  options.solve.problem.positions = std::move(positions.positions);
  options.has_other_rotations = command.run.rotations.has_value();
  SolveReport report;
  report.command = "solver";
  report.position_frame = std::move(positions.frame);
  return RunSolve(&command, *input, options, progress, std::move(report));
}

Outcome TriangulateCommand(const ModelPointer& model, const Progress& progress,
                           const py::dict& keywords) {
  Command command("pykrot.triangulate");
  TolerantSolveOptions options;
  AddSolveOptions(&options.solve, &command.context, &command.table);
  AssignKeywords(keywords, &command.table);
  CheckSolveOptions(options.solve, command.table);
  options.solve = PointsOnly(options.solve);
  SolveReport report;
  report.command = "point_triangulator";
  return RunSolve(&command, *model, options, progress, std::move(report));
}

Outcome FilterCommand(const ModelPointer& model, const Progress& progress,
                      const py::dict& keywords) {
  Command command("pykrot.filter");
  OutlierFilterOptions options;
  AddOutlierFilterOptions(&options, &command.context, &command.table);
  command.known.AddRotationsTo(&command.table);
  AssignKeywords(keywords, &command.table);
  ResolveOutlierFilterOptions(command.table, false, &options);
  const auto input = command.known.WithRotations(model, &command.run);
  Follow(progress, &options.solve);
  OutlierFilterResult result;
  command.Run(
      [&] { result = FilterOutliers(*input, options, command.context); });
  const OutlierReport report = {command.run, std::move(result.summary)};
  std::optional<std::string> certificate;
  if (report.summary.conflicts) {
    certificate = ConflictJson(*report.summary.conflicts);
  }
  return OutcomeOf(std::move(result.model), OutlierJson(report),
                   std::move(certificate));
}

// Returns the cured model.
Outcome CheckModelCommand(const ModelPointer& model, const Progress&,
                          const py::dict& keywords) {
  Command command("pykrot.check");
  command.table.AddThreads("num_threads", &command.context.num_threads,
                           "the result is the same, bit by bit");
  command.known.AddDatabaseTo(&command.table);
  AssignKeywords(keywords, &command.table);
  const std::optional<Database> database = command.known.Matches(*model);
  ModelCheckOptions options;
  if (database) options.database = &*database;
  CheckReport report;
  report.num_observations = static_cast<int64_t>(model->track_elements.size());
  ModelCure cure;
  command.Run([&] {
    report.check = CheckModel(*model, options, command.context);
    cure = CureModel(*model, report.check, options, command.context);
    report.seconds_check = command.timer.Seconds();
    report.pixel_error_before = Summarize(PixelErrors(*model));
    report.pixel_error_after = Summarize(PixelErrors(cure.model));
  });
  report.run = command.run;
  report.moved = std::move(cure.moved);
  if (!report.check.conventions)
    report.discarded = FindDiscardedCameras(*model);
  return OutcomeOf(std::move(cure.model), CheckJson(report));
}

Outcome AdjustCommand(const ModelPointer& model, const Progress& progress,
                      const py::dict& keywords) {
  Command command("pykrot.bundle_adjust");
  KnownFiles& known = command.known;
  AdjustmentOptions given;
  given.AddTo(&command.table);
  known.AddFixedTo(&command.table);
  known.AddPositionsTo(&command.table);
  known.AddDistancesTo(&command.table);
  AssignKeywords(keywords, &command.table);
  AdjustModelOptions options = given.Resolve(command.table);
  command.context.num_threads = given.num_threads();
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
  command.Run([&] { result = AdjustModel(input, options, command.context); });
  AdjustmentReport report;
  report.run = command.run;
  report.summary = std::move(result.summary);
  report.positions = survey.ComparePositions(result.model);
  report.position_frame = survey.frame();
  report.is_in_position_frame = survey.is_in_own_frame();
  report.distances = distances.Compare(result.model, report.summary);
  std::string json = AdjustmentJson(report, result.model);
  return OutcomeOf(std::move(result.model), std::move(json));
}

Outcome ToleranceCommand(const ModelPointer& model, const Progress& progress,
                         const py::dict& keywords) {
  Command command("pykrot.tolerances");
  ToleranceArguments arguments;
  AddToleranceOptions(&arguments, &command.context, &command.table);
  command.known.AddRotationsTo(&command.table);
  command.known.AddFixedTo(&command.table);
  AssignKeywords(keywords, &command.table);
  const auto input = command.known.WithRotations(model, &command.run);
  ToleranceOptions options = ResolveToleranceOptions(arguments, *input);
  options.solve.problem.fixed = command.known.Fixed(*input);
  Follow(progress, &options.solve);
  ToleranceReport report;
  ToleranceResult result;
  command.Run([&] {
    result = AnalyzeTolerances(*input, options, command.context);
    const int num_threads = command.context.num_threads;
    report.pixel_error_before = Summarize(PixelErrors(*input, num_threads));
    report.pixel_error_after =
        Summarize(PixelErrors(result.model, num_threads));
  });
  report.run = command.run;
  report.summary = std::move(result.summary);
  return OutcomeOf(std::move(result.model), ToleranceJson(report));
}

// The report as JSON; none if the models share too little to be aligned.
std::optional<std::string> CompareCommand(const ModelPointer& model1,
                                          const ModelPointer& model2,
                                          const std::string& alignment,
                                          int num_worst) {
  CompareModelsOptions options;
  OptionTable table("pykrot.compare", "", "docs/cli.md");
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
