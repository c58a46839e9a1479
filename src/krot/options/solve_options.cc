#include "krot/options/solve_options.h"

#include <vector>

namespace krot::internal {
namespace {

// Those that FastDescentSettings::kFast does not look at.
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

}  // namespace krot::internal
