#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/bridge/bridge.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The true residuals of a built problem, through the full cameras: what its
// linear rows stand for. The problem's Cost is that of the rows; TrueCost is
// what the user measures, and LevelledCost counts in how well positions are
// kept.
class Reprojection {
 public:
  // Keeps references.
  Reprojection(const Model& model, const BuiltProblem& built);

  // Whether no row depends on where it is taken, as for pinholes: then Cost and
  // TrueCost differ by rounding alone.
  bool IsLinear() const { return is_linear_; }

  // Whether observation i is one of the model: what Error and SourceOf are of.
  bool IsOfModel(int64_t i) const { return built_.HasPixel(i); }

  // ||pi(x_cam) - pixel||_p of observation i, which is one of the model, and
  // what the last digits of the coordinates may add to it: an estimate whose
  // points lie closer to a camera than its coordinates resolve is not as good
  // as it seems. Infinity where the point does not project, as behind its
  // camera.
  double Error(const Estimate& estimate, Norm norm, int64_t i) const;

  // The largest error, pixels; 0 without observations. O(observations); the
  // same bits at any number of threads.
  double TrueCost(const Estimate& estimate, Norm norm, int num_threads) const;

  // The same or, if that is more, the level of the positions times
  // LargestPositionRatio: what the rows are of, all of them.
  double LevelledCost(const Estimate& estimate, Norm norm,
                      int num_threads) const;

  // Takes every row where its point projects at the estimate: exact there, and
  // to first order around; likewise those of positions. Whether all do; a row
  // that does not stays.
  bool TakeRows(const Estimate& estimate, int num_threads,
                KnownRotationProblem* problem) const;

  // The camera of observation i of the model.
  struct Source {
    int model_id;
    const double* params;
  };
  const Source& SourceOf(int64_t i) const {
    return sources_[built_.problem.observations[i].view];
  }

  // x_cam of observation i.
  Eigen::Vector3d InCamera(const Estimate& estimate, int64_t i) const;

 private:
  double Resolution(const Estimate& estimate, int64_t i,
                    const Eigen::Vector3d& x_cam) const;

  const BuiltProblem& built_;
  std::vector<Source> sources_;  // per view
  bool is_linear_;
};

// Takes every row so that its residual is at most `level` pixels wherever the
// true error is, over the rays of krot/camera/remainder_bound.h: at the pixel's
// own bearing, and wider by what the lens bends there, or for a pinhole by what
// rounding does. What is proved of all estimates with residuals within the
// level is then proved of all with true errors within it.
//
// Whether an observation has such a row; without, the row stays. Requires level
// > 0 and p = 1, 2 or infinity. Some hundreds of microseconds for each.
std::vector<char> TakeOuterRows(const Model& model, const BuiltProblem& built,
                                Norm norm, double level, int num_threads,
                                KnownRotationProblem* problem);

}  // namespace krot::internal
