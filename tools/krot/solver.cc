#include <optional>
#include <string>
#include <vector>

#include "tools/krot/command.h"
#include "tools/krot/finish_options.h"
#include "tools/krot/solve_command.h"
#include "tools/krot/solve_options.h"

namespace krot {
namespace {

// The paper's own rule, where its settings are asked for [Zhang18, Sec. 5].
constexpr double kPaperSweepTolerance = 1e-3;

void AddScheduleOptions(SolveModelOptions* options, OptionParser* parser) {
  parser->AddNamed<SolveMethod>(
      "Solver.method", &options->method,
      {{"auto", SolveMethod::kAuto},
       {"res_int", SolveMethod::kResInt},
       {"joint", SolveMethod::kJoint}},
      "auto: sweeps while they pay, the joint solver to the gap, the finish; "
      "res_int: Resection-Intersection sweeps alone [Zhang18, Alg. 1], "
      "without a bound; joint: the joint solver alone");
  parser->AddReal("Solver.relative_gap", &options->joint.relative_gap,
                  Above(0.0),
                  "How far the largest error may be above the proved bound, "
                  "relative to it");
  parser->AddNamed<SolveInit>(
      "Solver.init", &options->init,
      {{"model", SolveInit::kModel}, {"feasible", SolveInit::kFeasible}},
      "Where to start: model: its own translations and points; feasible: from "
      "nothing but rotations and observations");
  parser->AddReal("Problem.init_max_error", &options->init_max_error,
                  Above(0.0, "pixels"),
                  "With a feasible start: the largest error that it may have");
  parser->AddInteger(
      "Joint.max_iterations", &options->joint.max_iterations, AtLeast(1),
      "Iterations per connected component and round after which to "
      "stop in any case");
}

void AddMaxError(std::optional<double>* max_error, OptionParser* parser) {
  parser->Add({"Solver.max_error",
               "The error that no observation may have: few are removed, as by "
               "outlier_filter, so that all others are within it",
               "a number > 0, pixels", "none is removed", false,
               [max_error](const std::string& text) {
                 double value = 0;
                 if (!ParseReal(text, &value) || !(value > 0)) return false;
                 *max_error = value;
                 return true;
               }});
}

void AddResIntOptions(const SolveModelOptions& defaults, ResIntOptions* options,
                      OptionParser* parser) {
  parser->Add({"ResInt.max_sweeps",
               "Sweeps after which to stop in any case; with method auto, "
               "those in front of the joint solver",
               "an integer >= 0",
               std::to_string(options->max_sweeps) + ", with method auto " +
                   std::to_string(defaults.max_leading_sweeps),
               false, [options](const std::string& text) {
                 return ParseInteger(text, &options->max_sweeps) &&
                        options->max_sweeps >= 0;
               }});
  parser->Add({"ResInt.sweep_tolerance",
               "Stop when a sweep lowers the cost by less",
               "a number >= 0, relative to the cost",
               NumberText(options->sweep_tolerance) + ", with paper settings " +
                   NumberText(kPaperSweepTolerance) + ", with method auto " +
                   NumberText(defaults.leading_sweep_tolerance),
               false, [options](const std::string& text) {
                 return ParseReal(text, &options->sweep_tolerance) &&
                        options->sweep_tolerance >= 0;
               }});
}

// What a method does not look at is refused.
void CheckPairs(const SolveModelOptions& options, const OptionParser& parser) {
  const SolveMethod method = EffectiveMethod(options);
  if (method != SolveMethod::kAuto || options.norm.p != 2) {
    parser.Refuse("Solver.max_error",
                  "but with --Solver.method auto and --Solver.norm 2");
  }
  if (parser.IsGiven("Solver.max_error")) {
    const char* why = "with --Solver.max_error, which the finish keeps to";
    parser.Refuse("Solver.finish_slack", why);
    parser.Refuse("Problem.init_max_error",
                  "with --Solver.max_error, which needs no such start");
  } else {
    parser.Refuse("conflicts_path", "without --Solver.max_error");
  }
  const bool has_joint_norm =
      options.norm.p == 2 || options.norm.IsPolyhedral();
  if (!has_joint_norm && options.method == SolveMethod::kJoint) {
    throw OptionError(
        "--Solver.method joint needs --Solver.norm 1, 2 or inf; sweeps alone "
        "(--Solver.method res_int) take any other");
  }
  if (!has_joint_norm && options.init == SolveInit::kFeasible) {
    throw OptionError("--Solver.init feasible needs --Solver.norm 1, 2 or inf");
  }
  if (method == SolveMethod::kResInt) {
    const char* why =
        "on sweeps alone, which know no bound; they are what --Solver.method "
        "res_int, --Solver.settings paper and any norm but 1, 2 and inf mean";
    parser.Refuse("Solver.relative_gap", why);
    parser.Refuse("Joint.max_iterations", why);
    parser.Refuse("certificate_path", why);
  }
  if (method == SolveMethod::kJoint) {
    for (const char* name : {"ResInt.max_sweeps", "ResInt.sweep_tolerance",
                             "Solver.settings", "FastDescent.max_iterations"}) {
      parser.Refuse(name, "with --Solver.method joint, which makes no sweeps");
    }
  }
  if (method != SolveMethod::kAuto && options.init == SolveInit::kModel) {
    parser.Refuse("Problem.init_max_error", "without --Solver.init feasible");
  }
}

// Defaults of the sweeps that depend on what they are for.
void ChooseSweeps(const OptionParser& parser, SolveModelOptions* options) {
  ResIntOptions& res_int = options->res_int;
  if (parser.IsGiven("ResInt.max_sweeps")) {
    options->max_leading_sweeps = res_int.max_sweeps;
  }
  if (parser.IsGiven("ResInt.sweep_tolerance")) {
    options->leading_sweep_tolerance = res_int.sweep_tolerance;
  } else if (res_int.fast_descent.settings == FastDescentSettings::kPaper) {
    res_int.sweep_tolerance = kPaperSweepTolerance;
  }
}

// Why sweeps alone, where nobody asked for them by name.
void ExplainMethod(const SolveCommand& command) {
  const SolveModelOptions& options = command.options;
  if (options.method == EffectiveMethod(options)) return;
  const bool is_paper =
      options.res_int.fast_descent.settings == FastDescentSettings::kPaper;
  LogLine(command.common.log, 1,
          is_paper ? "paper settings: sweeps alone, without a bound"
                   : "this norm has no joint solver: sweeps alone, without a "
                     "bound");
}

}  // namespace

int RunSolver(const std::vector<std::string>& arguments) {
  SolveCommand command;
  command.name = "solver";
  OptionParser parser(command.name,
                      "finds the lowest largest reprojection error of a COLMAP "
                      "model, and proves it; rotations, intrinsics and the "
                      "coordinate frame stay");
  AddModelPaths(&command.paths, &parser);
  parser.AddOutputFile("certificate_path", &command.certificate_path,
                       "Where the proof of the lower bound goes, as JSON; see "
                       "certificate_checker");
  parser.AddOutputFile("conflicts_path", &command.conflicts_path,
                       "With Solver.max_error: where the proof goes of how "
                       "many observations must be left out, as JSON; it takes "
                       "most of the time");
  AddScheduleOptions(&command.options, &parser);
  AddMaxError(&command.max_error, &parser);
  AddFinishOptions(&command.options, &parser);
  AddSolveOptions(&command.options, &command.context, &parser);
  AddResIntOptions(SolveModelOptions(), &command.options.res_int, &parser);
  AddCommonOptions(
      "Recorded in the report; this command draws no random "
      "numbers",
      &command.common, &parser);
  if (!parser.Parse(arguments)) {
    PrintTable(command.common.log, parser.Help());
    return kExitDone;
  }
  CheckSolveOptions(command.options, parser);
  CheckPairs(command.options, parser);
  CheckFinishOptions(command.options, parser);
  ChooseSweeps(parser, &command.options);
  ExplainMethod(command);
  return RunSolveCommand(command);
}

}  // namespace krot
