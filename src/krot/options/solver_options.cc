#include "krot/options/solver_options.h"

#include <optional>
#include <string>
#include <vector>

#include "krot/options/finish_options.h"
#include "krot/options/solve_options.h"

namespace krot::internal {
namespace {

// The paper's own rule, where its settings are asked for [Zhang18, Sec. 5].
constexpr double kPaperSweepTolerance = 1e-3;

void AddPixels(const std::string& name, const std::string& help,
               const std::string& default_text, std::optional<double>* pixels,
               OptionTable* table) {
  table->Add({name, help, "a number > 0, pixels", default_text, false,
              [pixels](const std::string& text) {
                double value = 0;
                if (!ParseReal(text, &value) || !(value > 0)) return false;
                *pixels = value;
                return true;
              }});
}

void AddScheduleOptions(SolveModelOptions* options, OptionTable* table) {
  table->AddNamed<SolveMethod>(
      "Solver.method", &options->method,
      {{"auto", SolveMethod::kAuto},
       {"res_int", SolveMethod::kResInt},
       {"joint", SolveMethod::kJoint}},
      "auto: sweeps, the joint solver, the finish; res_int: "
      "Resection-Intersection sweeps alone [Zhang18, Alg. 1], without a bound; "
      "joint: the joint solver alone");
  table->AddReal("Solver.relative_gap", &options->joint.relative_gap,
                 Above(0.0),
                 "How far the largest error may be above the proved bound, "
                 "relative to it");
  table->AddNamed<SolveInit>(
      "Solver.init", &options->init,
      {{"model", SolveInit::kModel}, {"feasible", SolveInit::kFeasible}},
      "Where to start: model: its own translations and points; feasible: from "
      "nothing but rotations and observations");
  table->AddReal("Problem.init_max_error", &options->init_max_error,
                 Above(0.0, "pixels"),
                 "With a feasible start: the largest error that it may have");
  AddPixels("Problem.inflate_positions",
            "Multiply all radii of known positions by the smallest factor at "
            "which the largest error can be at most this",
            "radii are as the files have them", &options->inflate_positions_to,
            table);
  table->AddInteger("Joint.max_iterations", &options->joint.max_iterations,
                    AtLeast(1),
                    "The most iterations per connected component and round");
}

void AddResIntOptions(const SolveModelOptions& defaults, ResIntOptions* options,
                      OptionTable* table) {
  table->Add(
      {"ResInt.max_sweeps",
       "The most sweeps; with method auto, those before the joint solver",
       "an integer >= 0",
       std::to_string(options->max_sweeps) + ", with method auto " +
           std::to_string(defaults.max_leading_sweeps),
       false, [options](const std::string& text) {
         return ParseInteger(text, &options->max_sweeps) &&
                options->max_sweeps >= 0;
       }});
  table->Add({"ResInt.sweep_tolerance",
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
void CheckPairs(const SolveModelOptions& options, const OptionTable& table) {
  const SolveMethod method = EffectiveMethod(options);
  if (method != SolveMethod::kAuto || options.norm.p != 2) {
    table.Refuse("Solver.max_error",
                 "but with --Solver.method auto and --Solver.norm 2");
  }
  if (table.IsGiven("Solver.max_error")) {
    const char* why = "with --Solver.max_error, which the finish keeps to";
    table.Refuse("Solver.finish_slack", why);
    table.Refuse("Problem.init_max_error",
                 "with --Solver.max_error, which needs no such start");
    for (const char* name : {"fixed_images_path", "fixed_points_path",
                             "positions_path", "point_positions_path"}) {
      table.Refuse(name, "with --Solver.max_error, which moves everything");
    }
  } else {
    table.Refuse("conflicts_path", "without --Solver.max_error");
  }
  if (!table.IsGiven("positions_path") &&
      !table.IsGiven("point_positions_path")) {
    for (const char* name :
         {"Problem.inflate_positions", "Problem.position_radius"}) {
      table.Refuse(name, "without --positions_path or --point_positions_path");
    }
  }
  if (!options.inflate_positions_to) {
    table.Refuse("factor_certificate_path",
                 "without --Problem.inflate_positions");
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
  if (options.norm.p != 2 || method == SolveMethod::kResInt ||
      options.polish != Polish::kNone) {
    for (const char* name : {"positions_path", "point_positions_path",
                             "Problem.inflate_positions"}) {
      table.Refuse(name,
                   "but with --Solver.norm 2, the joint solver, and no polish");
    }
  }
  if (method == SolveMethod::kResInt) {
    const char* why =
        "on sweeps alone, which know no bound; they are what --Solver.method "
        "res_int, --Solver.settings paper and any norm but 1, 2 and inf mean";
    table.Refuse("Solver.relative_gap", why);
    table.Refuse("Joint.max_iterations", why);
    table.Refuse("certificate_path", why);
  }
  if (method == SolveMethod::kJoint) {
    for (const char* name : {"ResInt.max_sweeps", "ResInt.sweep_tolerance",
                             "Solver.settings", "FastDescent.max_iterations"}) {
      table.Refuse(name, "with --Solver.method joint, which makes no sweeps");
    }
  }
  if (method != SolveMethod::kAuto && options.init == SolveInit::kModel) {
    table.Refuse("Problem.init_max_error", "without --Solver.init feasible");
  }
}

// Defaults of the sweeps that depend on what they are for.
void ChooseSweeps(const OptionTable& table, SolveModelOptions* options) {
  ResIntOptions& res_int = options->res_int;
  if (table.IsGiven("ResInt.max_sweeps")) {
    options->max_leading_sweeps = res_int.max_sweeps;
  }
  if (table.IsGiven("ResInt.sweep_tolerance")) {
    options->leading_sweep_tolerance = res_int.sweep_tolerance;
  } else if (res_int.fast_descent.settings == FastDescentSettings::kPaper) {
    res_int.sweep_tolerance = kPaperSweepTolerance;
  }
}

}  // namespace

void AddSolverOptions(TolerantSolveOptions* options, Context* context,
                      OptionTable* table) {
  SolveModelOptions* solve = &options->solve;
  AddScheduleOptions(solve, table);
  AddPixels("Solver.max_error",
            "Remove few observations, as outlier_filter does, so that all "
            "others are within this error",
            "none is removed", &options->max_error, table);
  AddFinishOptions(solve, table);
  AddSolveOptions(solve, context, table);
  AddResIntOptions(SolveModelOptions(), &solve->res_int, table);
}

void ResolveSolverOptions(const OptionTable& table,
                          SolveModelOptions* options) {
  CheckSolveOptions(*options, table);
  CheckPairs(*options, table);
  CheckFinishOptions(*options, table);
  ChooseSweeps(table, options);
}

}  // namespace krot::internal
