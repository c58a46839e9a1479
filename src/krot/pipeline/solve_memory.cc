#include "krot/pipeline/solve_memory.h"

#include <algorithm>

#include "krot/conic/interior_point.h"

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

}  // namespace

int64_t EstimateSolveBytes(const Model& model,
                           const KnownRotationProblem& problem,
                           SolveMethod method, Norm norm) {
  constexpr int64_t kProcess = 8000000;  // code and libraries
  // The record of a block, in sweeps.
  constexpr int64_t kBytesPerBlock = 200;
  // The start, the estimate, and those that sweeps and iterations compare.
  constexpr int64_t kEstimates = 5;
  const int64_t held = kProcess + ModelBytes(model) + ProblemBytes(problem) +
                       kEstimates * EstimateBytes(problem);
  const int64_t sweeps =
      kBytesPerBlock * (int64_t{problem.num_points} + problem.num_frames);
  // The joint solver works on a copy, one connected component at a time.
  const int64_t joint =
      method == SolveMethod::kResInt
          ? 0
          : ProblemBytes(problem) + EstimateInteriorPointMemory(problem, norm);
  // In the end, the model that is given back and the pixel errors.
  const int64_t result =
      ModelBytes(model) + Size(model.track_elements.size(), 2 * sizeof(double));
  return held + std::max({sweeps, joint, result});
}

}  // namespace krot
