#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/model.h"
#include "krot/model/fixed_parts.h"
#include "krot/model/positions_file.h"

namespace krot::internal {

// Coordinates of 10^6 to 10^7 m, as in UTM or ECEF, leave few digits for the
// scene in differences of R s and t, and cameras that turn about a distant
// origin are badly conditioned unknowns. A local frame has its origin O amid
// the model, at a round number: x_local = x - O is exact for points, t_local =
// t + R O is rounded once.
class LocalFrame {
 public:
  // O is near the median of what is fixed or known, or else of all finite
  // camera centres, or else of the points; zero, and all below are copies,
  // unless that is more than 10 times as far from the origin as half of these
  // are from it. Requires a valid model. O(images + points).
  explicit LocalFrame(const Model& model, const FixedParts& fixed = {},
                      const std::vector<KnownPosition>& known = {});

  const Eigen::Vector3d& origin() const { return origin_; }
  bool IsModels() const { return origin_.isZero(0); }

  // The model in the local frame.
  Model ToLocal(const Model& model) const;
  std::vector<KnownPosition> ToLocal(std::vector<KnownPosition> known) const;

  // What became of ToLocal(before) in the frame of `before`. What is there as
  // it was keeps the bits that it has in `before`. Requires the same images and
  // frames; points may be missing.
  Model FromLocal(const Model& before, const Model& local) const;

 private:
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
};

// solve(model), whose result has the new `model`, by way of the local frame.
template <typename Solve>
auto InLocalFrame(const LocalFrame& frame, const Model& model,
                  const Solve& solve) {
  if (frame.IsModels()) return solve(model);
  auto result = solve(frame.ToLocal(model));
  result.model = frame.FromLocal(model, result.model);
  return result;
}

}  // namespace krot::internal
