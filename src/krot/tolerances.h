#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/context.h"
#include "krot/model.h"
#include "krot/solve.h"

namespace krot {

// What the data allow: all positions that a camera or a point can have without
// any error above a bound, with rotations and intrinsics as given.

// One end of the interval in which a coordinate may be.
struct BoxEnd {
  double reached = 0;            // the value in an estimate that was found
  std::optional<double> proved;  // no estimate is beyond this; none: unbounded
};

// Smallest and largest value of each coordinate of a position, over all
// estimates within the bound; scene units.
struct PositionBox {
  std::array<BoxEnd, 3> low;
  std::array<BoxEnd, 3> high;
  int64_t num_programmes = 0;  // cone programmes solved for it
};

enum class ToleranceTermination {
  kNotRun,
  kNothingToSolve,  // every observation was left out
  kNoEstimate,      // no estimate within the bound was found
  kDone,
  kInterrupted,
};

// The box in which an image's centre or a point may be.
struct ToleranceBox {
  bool is_image = false;
  uint64_t id = 0;
  std::string name;                                    // of an image
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // in the resulting model
  // True if it has no box: it takes no part in the optimisation, or is not
  // connected to what holds place and scale.
  bool is_free = false;
  PositionBox box;
};

// Which boxes are asked for.
struct ToleranceRequest {
  double max_error = 0;  // the bound, pixels; > 0
  // How far the reached end may be from the proved one, relative to the proved
  // end's distance from the position; > 0.
  double tolerance = 0.01;
  // Indices in Model::images and Model::points3D: the boxes to find.
  std::vector<int32_t> images;
  std::vector<int32_t> points;
  // The indices of two images that hold place and scale. Empty: the parts that
  // the options fix hold them or, if there are none, two images are chosen.
  std::vector<int32_t> gauge_images;
};

struct TolerancesOptions : ToleranceRequest {
  // For the solve that finds an estimate within the bound, if the model itself
  // is not within it.
  SolveOptions solve;
};

struct TolerancesResult {
  // The input, or the solved model if the input is not within the bound.
  Model model;
  ToleranceTermination termination = ToleranceTermination::kNotRun;
  double max_error = 0;  // the largest of the model, pixels
  // kNoEstimate: proved that no estimate is below this; pixels.
  std::optional<double> lower_bound;
  std::vector<std::string> gauge_images;  // empty if the options fix something
  std::vector<ToleranceBox> boxes;        // images, then points, as asked for
};

// Finds the box of each position asked for. Each end is reached by an estimate
// and proved, and the two agree to `tolerance` unless lenses prevent it.
// Requires a valid model (ValidateModel). Throws std::invalid_argument for
// options out of range, and for gauge images that are not connected. A box
// takes about as long as a solve with the observations near it.
TolerancesResult FindTolerances(const Model& model,
                                const TolerancesOptions& options,
                                const Context& context = {});

}  // namespace krot
