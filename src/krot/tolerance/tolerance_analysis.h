#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "krot/base/context.h"
#include "krot/model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/tolerance/box_search.h"
#include "krot/tolerances.h"

namespace krot::internal {

// What the data allow: all positions that a camera or a point may have in an
// estimate whose errors are within a bound, with rotations and intrinsics as
// given. This is what `krot tolerance_analyzer` does between reading and
// writing.

struct ToleranceOptions {
  double max_error = 0;     // epsilon, pixels; > 0
  double tolerance = 0.01;  // of an end, relative to how far it is; > 0
  // Indices in Model::images and Model::points3D whose boxes are wanted.
  std::vector<int32_t> images;
  std::vector<int32_t> points;
  // The indices of two images that hold place and scale. Empty: what
  // solve.problem.fixed marks does or, if that is nothing, two images are
  // chosen.
  std::vector<int32_t> gauge_images;
  // Options of the problem, and of the solve that finds an estimate within the
  // bound if the model is none.
  SolveModelOptions solve;
  // Called once there is an estimate within the bound, then after every box,
  // with the number of boxes so far. May be empty; must be safe to call from
  // several threads.
  std::function<void(int64_t num_boxes)> on_box;
};

// How well the proved ends agree with the reached ones.
struct EndAgreement {
  int64_t num_ends = 0;
  int64_t num_proved = 0;
  // How far beyond what was reached the worst proved end is, relative to the
  // way there from the position.
  double worst = 0;
};

struct ToleranceSummary {
  ToleranceTermination termination = ToleranceTermination::kNotRun;
  double max_error = 0;  // as asked for, pixels
  Norm norm;
  double cost = 0;  // the largest error of the resulting model, pixels
  // Whether the model had to be solved first, and the bound that this proved,
  // pixels.
  bool is_solved = false;
  std::optional<double> lower_bound;
  int64_t num_frames = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  int64_t num_rowless = 0;     // observations without an outer row
  int64_t num_far_points = 0;  // which bound no camera: see FindFarPoints
  int64_t num_programmes = 0;
  int64_t num_fixed_frames = 0;  // by options, not by the gauge
  int64_t num_fixed_points = 0;
  std::vector<std::string> gauge_images;  // empty if the options fix something
  std::vector<ToleranceBox> boxes;        // images, then points, as asked for
  // In the frame in which they are found: far from the origin the last digits
  // of coordinates are as large as a narrow box.
  EndAgreement agreement;
  double seconds = 0;
};

struct ToleranceResult {
  Model model;  // the input, or the solved one; the boxes are around it
  ToleranceSummary summary;
};

// Requires a valid model (ValidateModel). Throws std::invalid_argument for
// options out of range, and for gauge images that are not connected. The same
// bits at any number of threads.
ToleranceResult AnalyzeTolerances(const Model& model,
                                  const ToleranceOptions& options,
                                  const Context& context = {});

}  // namespace krot::internal
