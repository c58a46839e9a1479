#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/reprojection.h"
#include "krot/geometry.h"
#include "krot/joint/joint.h"
#include "krot/linear/blocks.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/pipeline/solve_model.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/tolerances.h"
#include "krot/verify/certificate_check.h"
#include "krot/verify/force_checker.h"

namespace krot::internal {

// A linear function of positions: the sum of p'x over pulls. A single pull
// gives a coordinate, two opposite ones a coordinate of a difference.
using Pulls = std::vector<Pull>;

// The value of the sum at an estimate.
double Along(const KnownRotationProblem& problem, const Estimate& estimate,
             const Pulls& pulls);

// The relative rounding error of the few operations behind a proof's check.
inline constexpr double kProofRounding =
    8 * std::numeric_limits<double>::epsilon();

// A row that keeps the scale where nothing else does: for a view's centre or a
// point, direction'x stays what it is at the start.
using ScaleRow = Pull;

struct ExtentOptions {
  Norm norm;                // p = 1, 2 or infinity
  double bound = 0;         // of all residuals, pixels; > 0
  double tolerance = 0.01;  // of the way from the start to the proved end; > 0
};

// How far estimates reach whose residuals are all below the bound.
struct Extent {
  Estimate estimate;             // that reaches the farthest
  std::optional<double> proved;  // bounds the sum (CheckExtent); scene units
};

// Maximises the sum of p'x over `pulls` from `start`, which must be below the
// bound. Nothing is proved where there is no end, or where double precision
// does not suffice. The problem must be connected, and something in it fixed,
// but nothing that a pull acts on.
Extent FindExtent(const KnownRotationProblem& problem, const Pulls& pulls,
                  const std::optional<ScaleRow>& scale,
                  const ExtentOptions& options, const Context& context,
                  const Estimate& start);

// The gradient of the sum by points and frames' centres; 0 where they are
// fixed.
BlockVector CoefficientsOf(const KnownRotationProblem& problem,
                           const Pulls& pulls);

// What may be infinitely far away, and so says nothing about all else.
struct FarParts {
  std::vector<char> points;
  std::vector<char> frames;
};

// Marks the points and frames of the given observations (ascending) whose
// residuals are all below `bound`, pixels, when the point, or the frame, is
// infinitely far away in some direction. Such a point fits in wherever the
// frames are, if it is far enough away, and such a frame wherever the points
// are. So they are left out, and the rest is looked at anew. What is fixed is
// not marked. O(observations) for each time.
FarParts FindFarParts(const KnownRotationProblem& problem,
                      std::vector<int64_t> observations, Norm norm,
                      double bound, const Context& context);

// What holds place and scale of the estimates.
struct ToleranceGauge {
  // Each is a view or a point. The first is fixed (of a view the frame). If
  // that leaves the scale free, the second keeps its distance from the first
  // along the line between the two. Without a first, what the problem fixes
  // holds both.
  std::optional<Pull> first;
  std::optional<Pull> second;
};

// A gauge for a problem that fixes nothing: the view with the most observations
// and, of the views connected to it, the one that is farthest away in the
// estimate, but for frames marked as far where there are others. No second if a
// baseline sets the scale.
ToleranceGauge ChooseGauge(const KnownRotationProblem& problem,
                           const Estimate& estimate,
                           const std::vector<char>& is_far_frame);

// The estimates whose true errors are all at most `bound`, in a gauge: the
// problem that all boxes are about.
class ToleranceProblem {
 public:
  // `centre` is an estimate whose errors are all below the bound; what the
  // gauge holds is held where it is there. Keeps references to all arguments
  // but the gauge. Takes the rows of `built` anew (TakeOuterRows).
  ToleranceProblem(const Model& model, BuiltProblem* built,
                   const Estimate& centre, const ToleranceGauge& gauge,
                   Norm norm, double bound, const Context& context);

  const Model& model() const { return model_; }
  const BuiltProblem& built() const { return built_; }
  const KnownRotationProblem& problem() const { return built_.problem; }
  const Estimate& centre() const { return centre_; }
  const std::optional<ScaleRow>& scale() const { return scale_; }
  const ToleranceGauge& gauge() const { return gauge_; }
  Norm norm() const { return norm_; }
  double bound() const { return bound_; }

  // The part of the problem that bounds anything and is connected to something
  // fixed: without observations that have no outer row, and without far points
  // and frames other than targets. None if it does not contain all targets that
  // may move.
  std::optional<ProblemSubset> UsablePart(const Pulls& targets) const;

  int64_t num_rowless() const { return num_rowless_; }
  int64_t num_far_points() const { return num_far_points_; }

 private:
  const Model& model_;
  const BuiltProblem& built_;
  const Estimate& centre_;
  const ToleranceGauge gauge_;
  const Norm norm_;
  const double bound_;
  std::optional<ScaleRow> scale_;
  std::vector<char> has_row_;  // per observation
  FarParts far_;
  int64_t num_rowless_ = 0;
  int64_t num_far_points_ = 0;
};

// The given observations whose connected component has something fixed;
// ascending.
std::vector<int64_t> HeldObservations(const KnownRotationProblem& problem,
                                      std::vector<int64_t> observations);

// Finds the box by working sets: an end that is proved with some observations
// holds for all, and it is reached if the other points fit in, too
// (docs/method/outliers.md, "What the data allow"). The reached and the proved
// end agree to `tolerance`, relative to the way from the centre, unless lenses
// prevent it. The direction of `target` does not matter.
PositionBox FindBox(const ToleranceProblem& problem, const Pull& target,
                    double tolerance, const Context& context);

// The least and the greatest length of a difference of two positions.
struct LengthRange {
  BoxEnd low;
  BoxEnd high;
  int64_t num_programmes = 0;
};

// The same for |x_2 - x_1|, in the gauge's unit. With u the difference's
// direction at the centre and v, w across, both ends of the difference along u
// are proved, and its largest values along v and w. So |x_2 - x_1| is at least
// the least along u, and at most the diagonal of the box
// (docs/method/outliers.md, "Lengths"). Both ends are proved together, or
// neither. If `unit` is given, what is reached is scaled so that `unit` has the
// length that it has at the centre.
LengthRange FindLength(const ToleranceProblem& problem,
                       const std::array<Pull, 2>& targets,
                       const std::optional<std::array<Pull, 2>>& unit,
                       double tolerance, const Context& context);

// What the data allow: all positions that a camera or a point may have in an
// estimate whose errors are within a bound, with rotations and intrinsics as
// given. This is what `krot tolerance_analyzer` does between reading and
// writing.

struct ToleranceOptions : ToleranceRequest {
  // Distances whose least and greatest length are wanted. The first with metres
  // is the scale bar: all lengths are in metres then, and otherwise in scene
  // units.
  std::vector<KnownDistance> distances;
  // Options of the problem, and of the solve that finds an estimate within the
  // bound if the model is none.
  SolveModelOptions solve;
  // Called once there is an estimate within the bound, and then after every box
  // and every length, with the number of them so far. May be empty; must be
  // safe to call from several threads.
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

// What the data allow a distance to be; in metres where there is a scale bar.
struct ToleranceLength {
  std::string name;              // "a.jpg to b.jpg"
  std::optional<double> metres;  // as it is known
  double tolerance = 0;          // of that
  bool is_bar = false;
  double length = 0;  // in the resulting model
  // It has no ends, because one of its positions takes no part, or is not
  // connected to what holds the scale.
  bool is_free = false;
  BoxEnd low;
  BoxEnd high;

  // Whether it is proved that its length is not the known one.
  bool IsContradicted() const {
    return metres && low.proved && high.proved &&
           (*metres + tolerance < *low.proved ||
            *metres - tolerance > *high.proved);
  }
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
  int64_t num_far_points = 0;  // which bound no camera: see FindFarParts
  int64_t num_programmes = 0;
  int64_t num_fixed_frames = 0;  // by options, not by the gauge
  int64_t num_fixed_points = 0;
  std::vector<std::string> gauge_images;  // empty if the options fix something
  std::vector<ToleranceBox> boxes;        // images, then points, as asked for
  std::vector<ToleranceLength> lengths;   // as ToleranceOptions::distances
  // Compared in the local frame, where the ends are found: far from the origin
  // rounding of coordinates may be as large as a narrow box.
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
