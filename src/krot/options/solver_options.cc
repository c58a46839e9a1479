#include "krot/options/command_options.h"

#include <optional>
#include <string>
#include <vector>

namespace krot::internal {
namespace {

// Options that FastDescentSettings::kFast does not use.
const std::vector<std::string> kPaperOnlyNames = {
    "FastDescent.stationarity_tolerance", "FastDescent.step_tolerance",
    "FastDescent.slope_probe", "FastDescent.active_tolerance",
    "FastDescent.max_step"};

bool ParseNorm(const std::string& text, Norm* norm) {
  if (text == "inf") {
    *norm = Norm::LInf();
    return true;
  }
  double p = 0;
  if (!ParseReal(text, &p) || p < 1) return false;
  norm->p = p;
  return true;
}

void AddFastDescentOptions(FastDescentOptions* options, OptionTable* table) {
  table->AddReal("FastDescent.stationarity_tolerance",
                 &options->stationarity_tolerance, AtLeast(0.0),
                 "With paper settings: epsilon_0, how near to 0 the centre of "
                 "the smallest ball has to be");
  table->AddReal("FastDescent.step_tolerance", &options->step_tolerance,
                 Above(0.0, "scene units"),
                 "With paper settings: epsilon_1, the interval at which the "
                 "line search ends");
  table->AddReal(
      "FastDescent.slope_probe", &options->slope_probe,
      Above(0.0, "scene units"),
      "With paper settings: epsilon_2, how far away the slope's sign is taken");
  table->AddReal("FastDescent.active_tolerance", &options->active_tolerance,
                 InHalfOpen(0.0, 1.0, "relative to the cost"),
                 "With paper settings: residuals this close to the largest "
                 "are active");
  table->AddReal("FastDescent.max_step", &options->max_step,
                 Above(0.0, "scene units"),
                 "With paper settings: the longest step");
  table->AddInteger("FastDescent.max_iterations", &options->max_iterations,
                    AtLeast(1), "Iterations per point or frame and sweep");
}

}  // namespace

void AddSolveOptions(SolveModelOptions* options, Context* context,
                     OptionTable* table) {
  ResIntOptions* res_int = &options->res_int;
  table->Add({"Solver.norm", "The p of the residuals' norm",
              "1, 2, inf or a number >= 1", "2", false,
              [options](const std::string& text) {
                return ParseNorm(text, &options->norm);
              }});
  table->AddThreads("Solver.num_threads", &context->num_threads,
                    "the result is the same, bit by bit");
  table->AddNamed<FastDescentSettings>("Solver.settings",
                                       &res_int->fast_descent.settings,
                                       {{"fast", FastDescentSettings::kFast},
                                        {"paper", FastDescentSettings::kPaper}},
                                       "paper: Algorithms 2 to 4 as published; "
                                       "fast: the same optima in less time");
  AddFastDescentOptions(&res_int->fast_descent, table);
  table->AddInteger("Problem.min_track_length",
                    &options->problem.min_track_length,
                    AtLeast(1, "observations"),
                    "Leave out points with fewer usable observations; they "
                    "stay in the model");
  AddSameImage(&options->problem, table);
}

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

void AddSameImage(BuildProblemOptions* options, OptionTable* table) {
  table->AddNamed<SameImage>(
      "Problem.same_image", &options->same_image,
      {{"keep", SameImage::kKeep}, {"closest", SameImage::kClosest}},
      "Of an image's observations in one track: keep all, or only the one "
      "closest to the model's point; the others stay in the model but count in "
      "no maximum");
}

void CheckSolveOptions(const SolveModelOptions& options,
                       const OptionTable& table) {
  if (options.res_int.fast_descent.settings == FastDescentSettings::kPaper) {
    return;
  }
  for (const std::string& name : kPaperOnlyNames) {
    table.Refuse(name,
                 "with --Solver.settings fast; add --Solver.settings paper or "
                 "leave it out");
  }
}

void AddFinishOptions(SolveModelOptions* options, OptionTable* table) {
  FinishOptions* finish = &options->finish;
  table->AddNamed<Finish>(
      "Solver.finish", &finish->finish,
      {{FinishName(Finish::kLeastSquares), Finish::kLeastSquares},
       {FinishName(Finish::kNone), Finish::kNone}},
      "With method auto: least_squares: end at the least squares of all "
      "estimates within finish_slack of the lowest maximum; none: end at the "
      "lowest maximum");
  table->AddReal("Solver.finish_slack", &finish->slack,
                 Above(0.0, "relative to the lowest maximum"),
                 "With finish least_squares: how far above the lowest maximum "
                 "an error may be");
  AddFinishLoss(options, table);
  table->AddNamed<Polish>(
      "Solver.polish", &options->polish,
      {{PolishName(Polish::kNone), Polish::kNone},
       {PolishName(Polish::kRotationsFixed), Polish::kRotationsFixed},
       {PolishName(Polish::kFull), Polish::kFull}},
      "A bundle adjustment at the end, which gives up the lowest maximum: "
      "rotations_fixed: of translations and points; full: as bundle_adjuster");
}

void AddFinishLoss(SolveModelOptions* options, OptionTable* table) {
  ErrorLoss* loss = &options->finish.loss;
  table->AddNamed<ErrorLoss::Kind>(
      "Solver.finish_loss", &loss->kind,
      {{LossName(ErrorLoss::Kind::kTrivial), ErrorLoss::Kind::kTrivial},
       {LossName(ErrorLoss::Kind::kHuber), ErrorLoss::Kind::kHuber},
       {LossName(ErrorLoss::Kind::kCauchy), ErrorLoss::Kind::kCauchy}},
      "The loss of the squared errors; huber and cauchy count large ones less");
  table->AddReal("Solver.finish_loss_scale", &loss->scale, Above(0.0, "pixels"),
                 "With huber or cauchy: the error above which it counts less");
}

void CheckFinishLoss(const SolveModelOptions& options,
                     const OptionTable& table) {
  if (options.finish.loss.kind != ErrorLoss::Kind::kTrivial) return;
  table.Refuse("Solver.finish_loss_scale",
               "without --Solver.finish_loss huber or cauchy");
}

void CheckFinishOptions(const SolveModelOptions& options,
                        const OptionTable& table) {
  const bool has_least_squares = options.finish.finish == Finish::kLeastSquares;
  if (!has_least_squares) {
    table.RefuseAll({"Solver.finish_slack", "Solver.finish_loss",
                     "Solver.finish_loss_scale"},
                    "without --Solver.finish least_squares");
  }
  CheckFinishLoss(options, table);
  if (EffectiveMethod(options) == SolveMethod::kAuto) return;
  table.RefuseAll({"Solver.finish", "Solver.finish_slack", "Solver.finish_loss",
                   "Solver.finish_loss_scale"},
                  "but with --Solver.method auto");
}

namespace {

// The paper's stopping rule, which comes with its settings [Zhang18, Sec. 5].
constexpr double kPaperSweepTolerance = 1e-3;

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

// Refuses options that the chosen method does not use, and pairs that
// contradict each other.
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
    table.RefuseAll({"fixed_images_path", "fixed_points_path", "positions_path",
                     "point_positions_path"},
                    "with --Solver.max_error, which moves everything");
  } else {
    table.Refuse("conflicts_path", "without --Solver.max_error");
  }
  if (!table.IsGiven("positions_path") &&
      !table.IsGiven("point_positions_path")) {
    table.Refuse("Problem.inflate_positions",
                 "without --positions_path or --point_positions_path");
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
    table.RefuseAll(
        {"positions_path", "point_positions_path", "Problem.inflate_positions"},
        "but with --Solver.norm 2, the joint solver, and no polish");
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
    table.RefuseAll({"ResInt.max_sweeps", "ResInt.sweep_tolerance",
                     "Solver.settings", "FastDescent.max_iterations"},
                    "with --Solver.method joint, which makes no sweeps");
  }
  if (method != SolveMethod::kAuto && options.init == SolveInit::kModel) {
    table.Refuse("Problem.init_max_error", "without --Solver.init feasible");
  }
}

// Sets defaults of the sweeps that depend on their purpose.
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
