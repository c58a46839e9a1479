#include "krot/pipeline/solve_model.h"

#include <algorithm>
#include <vector>

#include "krot/joint/working_set.h"
#include "krot/linear/reduced_camera_system.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"
#include "krot/pipeline/stages.h"
#include "krot/problem/centre_unknowns.h"
#include "krot/problem/cost.h"
#include "krot/problem/subset.h"

namespace krot::internal {
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

// Bytes of the observations with two indices to each, and of the views, points
// and frames.
int64_t ProblemBytes(const KnownRotationProblem& problem) {
  return Size(problem.observations.size(), sizeof(Observation) + 8) +
         Size(problem.views.size(), sizeof(View)) +
         8 * (int64_t{problem.num_points} + problem.num_frames);
}

int64_t EstimateBytes(const KnownRotationProblem& problem) {
  return 24 * (int64_t{problem.num_points} + problem.num_frames);
}

// Bytes of a subset of a problem: a problem of its own, and the indices of its
// observations.
int64_t PartBytes(const KnownRotationProblem& problem) {
  return ProblemBytes(problem) + Size(problem.observations.size(), 8);
}

// The first working set of the joint solver, as a problem.
ProblemSubset FirstWorkingProblem(const BuiltProblem& built, Norm norm,
                                  const Context& context) {
  const KnownRotationProblem& problem = built.problem;
  const double cost = Cost(problem, built.start, norm, context.num_threads);
  const WorkingSet set =
      FirstWorkingSet(problem, built.start, norm, cost, context);
  return ProblemSubset(problem, set.Observations());
}

// Bytes of an interior point on this problem: a constant for each observation,
// and the reduced camera system.
int64_t InteriorPointBytes(const KnownRotationProblem& problem,
                           size_t bytes_per_observation) {
  return Size(problem.observations.size(), bytes_per_observation) +
         ReducedCameraSystem(AnchoredStructure(problem)).MemoryBytes();
}

}  // namespace

int64_t EstimateSolveMemory(const Model& model, const BuiltProblem& built,
                            const SolveSummary& summary,
                            const Context& context) {
  constexpr int64_t kProcess = 14000000;  // code and libraries
  // What sweeps store per point and per frame.
  constexpr int64_t kBytesPerBlock = 200;
  // The start, the estimate, and the copies that sweeps and iterations compare.
  constexpr int64_t kEstimates = 5;
  // Bytes per observation, counted in the code of the joint solver and of the
  // finish.
  constexpr size_t kJointBytes = 600;
  constexpr size_t kFinishBytes = 300;
  // The allocator holds more memory than is in use, by this factor.
  constexpr double kAllocated = 1.05;
  const KnownRotationProblem& problem = built.problem;
  const int64_t held = kProcess + ModelBytes(model) + ProblemBytes(problem) +
                       kEstimates * EstimateBytes(problem);
  const int64_t sweeps =
      kBytesPerBlock * (int64_t{problem.num_points} + problem.num_frames);
  // In the end: the model that is returned, and the pixel errors.
  const int64_t result =
      ModelBytes(model) + Size(model.track_elements.size(), 2 * sizeof(double));
  int64_t most = std::max(sweeps, result);
  // Which observation is in which component and working set, and a copy of the
  // largest component unless there is only one.
  const int64_t component =
      Size(problem.observations.size(), 16) +
      (summary.num_components > 1 ? PartBytes(problem) : 0);
  if (summary.init == SolveInit::kFeasible) {
    most = std::max(most, component + InteriorPointBytes(problem, kJointBytes));
  } else if (summary.method != SolveMethod::kResInt) {
    // Sweeps, which place the points outside the working set, hold their memory
    // at the same time as the interior point.
    const ProblemSubset working =
        FirstWorkingProblem(built, summary.norm, context);
    most =
        std::max(most, component + PartBytes(working.problem()) + sweeps +
                           InteriorPointBytes(working.problem(), kJointBytes));
    if (summary.method == SolveMethod::kAuto) {
      most = std::max(most, InteriorPointBytes(problem, kFinishBytes));
    }
  }
  return static_cast<int64_t>(kAllocated * static_cast<double>(held + most));
}

namespace {

// Replaces the fixed positions of a certificate, which are in the local frame,
// by those of the model, to the bit.
void PlaceFixed(const Model& model, CertificateFile* certificate) {
  if (!certificate->fixed_images.empty()) {
    const std::vector<ImageGeometry> geometries = ImageGeometries(model);
    const IdIndex<ImageId> images(model.images);
    for (CertificateFile::FixedImage& fixed : certificate->fixed_images) {
      const int32_t frame = geometries[*images.Find(fixed.image_id)].frame;
      fixed.translation = model.frames[frame].rig_from_world.translation;
    }
  }
  const IdIndex<Point3DId> points(model.points3D);
  for (CertificateFile::FixedPoint& fixed : certificate->fixed_points) {
    fixed.xyz = model.points3D[*points.Find(fixed.point3D_id)].xyz;
  }
}

// The same for the regions of known positions.
void PlaceKnown(const Model& model, const std::vector<KnownPosition>& known,
                CertificateFile* certificate) {
  for (CertificateFile::Position& position : certificate->positions) {
    for (const KnownPosition& k : known) {
      const bool is_images = k.of == KnownPosition::Of::kImage;
      const uint64_t id =
          is_images ? model.images[k.index].id : model.points3D[k.index].id;
      if (k.of == position.of && id == position.id) position.region = k.region;
    }
  }
}

}  // namespace

SolveMethod EffectiveMethod(const SolveModelOptions& options) {
  if (options.method != SolveMethod::kAuto) return options.method;
  const bool as_in_paper =
      options.res_int.fast_descent.settings == FastDescentSettings::kPaper;
  return as_in_paper || !HasJointSolver(options.norm) ? SolveMethod::kResInt
                                                      : SolveMethod::kAuto;
}

SolveModelResult SolveModel(const Model& model,
                            const SolveModelOptions& options,
                            const Context& context) {
  if (options.inflate_positions_to) {
    return SolveWithInflatedPositions(model, options, context);
  }
  const BuildProblemOptions& known = options.problem;
  const LocalFrame frame(model, known.fixed, known.positions);
  SolveModelOptions local_options = options;
  local_options.problem.positions = frame.ToLocal(known.positions);
  SolveModelResult result = InLocalFrame(frame, model, [&](const Model& local) {
    return SolveInFrame(local, local_options, context);
  });
  if (result.summary.certificate) {
    PlaceFixed(model, &*result.summary.certificate);
    PlaceKnown(model, known.positions, &*result.summary.certificate);
  }
  return result;
}

SolveModelResult TriangulateModel(const Model& model,
                                  const SolveModelOptions& options,
                                  const Context& context) {
  return SolveModel(model, PointsOnly(options), context);
}

SolveModelOptions PointsOnly(SolveModelOptions options) {
  options.method = SolveMethod::kResInt;
  options.init = SolveInit::kModel;
  options.polish = Polish::kNone;
  options.res_int.update_frames = false;
  options.res_int.max_sweeps = 1;
  return options;
}

}  // namespace krot::internal
