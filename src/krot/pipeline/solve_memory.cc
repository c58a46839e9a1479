#include "krot/pipeline/solve_memory.h"

#include <algorithm>

#include "krot/conic/interior_point.h"
#include "krot/finish/bounded_least_squares.h"
#include "krot/joint/working_set.h"
#include "krot/problem/cost.h"
#include "krot/problem/subset.h"
#include "krot/proof/dual_repair.h"

namespace krot {
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

// The observations and two indices to them; views, points and frames.
int64_t ProblemBytes(const KnownRotationProblem& problem) {
  return Size(problem.observations.size(), sizeof(Observation) + 8) +
         Size(problem.views.size(), sizeof(View)) +
         8 * (int64_t{problem.num_points} + problem.num_frames);
}

int64_t EstimateBytes(const KnownRotationProblem& problem) {
  return 24 * (int64_t{problem.num_points} + problem.num_frames);
}

// Some of a problem's observations, as a problem, and their indices.
int64_t PartBytes(const KnownRotationProblem& problem) {
  return ProblemBytes(problem) + Size(problem.observations.size(), 8);
}

int64_t JointBytes(const KnownRotationProblem& problem, Norm norm) {
  return EstimateInteriorPointMemory(problem, norm) +
         KnownMultipliers::MemoryBytes(
             static_cast<int64_t>(problem.observations.size()));
}

// What the joint solver looks at first.
ProblemSubset FirstWorkingProblem(const BuiltProblem& built, Norm norm,
                                  const Context& context) {
  const KnownRotationProblem& problem = built.problem;
  const double cost = Cost(problem, built.start, norm, context.num_threads);
  const WorkingSet set =
      FirstWorkingSet(problem, built.start, norm, cost, context);
  return ProblemSubset(problem, set.Observations());
}

// What is in use when most is.
SolveMemory CountSolveMemory(const Model& model, const BuiltProblem& built,
                             const SolveSummary& summary,
                             const Context& context) {
  constexpr int64_t kProcess = 14000000;  // code and libraries
  // The record of a block, in sweeps.
  constexpr int64_t kBytesPerBlock = 200;
  // The start, the estimate, and those that sweeps and iterations compare.
  constexpr int64_t kEstimates = 5;
  const KnownRotationProblem& problem = built.problem;
  const int64_t held = kProcess + ModelBytes(model) + ProblemBytes(problem) +
                       kEstimates * EstimateBytes(problem);
  const int64_t sweeps =
      kBytesPerBlock * (int64_t{problem.num_points} + problem.num_frames);
  // In the end, the model that is given back and the pixel errors.
  const int64_t result =
      ModelBytes(model) + Size(model.track_elements.size(), 2 * sizeof(double));
  SolveMemory memory;
  memory.likely = memory.at_most = held + std::max(sweeps, result);
  if (summary.method == SolveMethod::kResInt &&
      summary.init == SolveInit::kModel) {
    return memory;
  }
  // The lists of which observation is in which component and working set, and
  // the largest component, which is a copy unless there is but one.
  const int64_t component =
      held + Size(problem.observations.size(), 16) +
      (summary.num_components > 1 ? PartBytes(problem) : 0);
  const int64_t joint = component + JointBytes(problem, summary.norm);
  memory.at_most =
      std::max(memory.at_most, joint + EstimateRepairMemory(problem));
  if (summary.init == SolveInit::kFeasible) {
    memory.likely = std::max(memory.likely, joint);
    return memory;
  }
  // Beside the interior point, sweeps place what it does not look at.
  const ProblemSubset subset =
      FirstWorkingProblem(built, summary.norm, context);
  const KnownRotationProblem& working = subset.problem();
  memory.likely =
      std::max(memory.likely, component + PartBytes(working) +
                                  JointBytes(working, summary.norm) + sweeps);
  if (summary.method == SolveMethod::kAuto) {
    memory.likely = std::max(
        memory.likely, held + EstimateBoundedMemory(problem, summary.norm));
  }
  memory.at_most = std::max(memory.at_most, memory.likely);
  return memory;
}

}  // namespace

SolveMemory EstimateSolveMemory(const Model& model, const BuiltProblem& built,
                                const SolveSummary& summary,
                                const Context& context) {
  // What the allocator keeps beside what is in use.
  constexpr double kAllocated = 1.05;
  const auto resident = [](int64_t bytes) {
    return static_cast<int64_t>(kAllocated * static_cast<double>(bytes));
  };
  const SolveMemory counted = CountSolveMemory(model, built, summary, context);
  return {resident(counted.likely), resident(counted.at_most)};
}

}  // namespace krot
