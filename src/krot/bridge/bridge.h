#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "krot/model/model.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Between a COLMAP model and the known rotation problem.

// Why an observation takes no part in the optimisation. It stays in the model.
enum class LeftOut {
  kBehind,        // not in front of its camera, even after re-triangulation
  kUndistortion,  // no trustworthy ray for this pixel
  kOffAxis,       // 90 degrees or more off the optical axis
  kShortTrack,    // fewer than min_track_length usable observations
  kNoPose,        // the image's translation is not finite
  kSingleRay,     // all rays of the point leave one camera centre in parallel
};
inline constexpr int kNumLeftOutReasons = 6;
// "behind", "undistortion", "off_axis", "short_track", "no_pose",
// "single_ray".
const char* LeftOutName(LeftOut reason);

struct BuildProblemOptions {
  int min_track_length = 2;  // >= 1, observations
  // Observations whose linearised residual exceeds this are left out... of no
  // use for res_int; reserved: see docs/cli.md, --Problem.max_error.
  int num_threads = -1;
};

// The problem, its start, and where each unknown lives in the model.
struct BuiltProblem {
  KnownRotationProblem problem;
  Estimate start;  // the model's own, with re-triangulated points
  std::vector<int32_t> frame_of;  // problem frame -> index in model.frames
                                  // (model.images if !model.has_rigs)
  std::vector<int32_t> image_of;  // problem view -> index in model.images
  std::vector<int32_t> point_of;  // problem point -> index in model.points3D
  std::vector<int32_t> point2D_of;  // observation -> index in image.points2D
  std::array<int64_t, kNumLeftOutReasons> left_out = {};
  int64_t num_retriangulated_points = 0;
};

// Requires a valid model (ValidateModel). Throws ModelError for cameras
// without an image plane. O(observations).
BuiltProblem BuildProblem(const Model& model,
                          const BuildProblemOptions& options);

// A copy of `model` with the estimate's translations (frames and images both,
// consistent) and points. Everything else is unchanged.
Model ApplyEstimate(const Model& model, const BuiltProblem& built,
                    const Estimate& estimate);

}  // namespace krot
