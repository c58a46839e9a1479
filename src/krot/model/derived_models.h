#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/model.h"
#include "krot/model/model_io.h"

namespace krot::internal {

// The points that each of `count` processes takes of a model, as indices of its
// points3D, ascending: consecutive ones in the order of their ids, with about
// as many observations. O(points log points).
std::vector<std::vector<int32_t>> CutPoints(const Model& whole, int count);

// All of a model but for the other points, their tracks, and the 2D points that
// no track here names.
struct ModelShare {
  Model model;
  // Per image: what its 2D points are called in the whole.
  std::vector<std::vector<uint32_t>> point2D_of;
};

// `points` as CutPoints gives them. Requires a valid model (ValidateModel).
ModelShare TakeShare(const Model& whole, const std::vector<int32_t>& points);

struct RemovedObservations {
  Model model;
  std::vector<uint64_t> element_of;  // what each track element was
  // Elements that went because fewer than two of their track were left.
  int64_t num_left_alone = 0;
  int64_t num_points = 0;  // whose tracks went with them
};

// A copy of `model` without the track elements that `is_removed` marks, and
// without the points that keep fewer than two. 2D points that belong to no
// track any more name no 3D point; images and 2D points all stay, and so does
// every order. Requires a valid model; throws std::invalid_argument unless
// there is one mark per element.
RemovedObservations RemoveObservations(const Model& model,
                                       const std::vector<char>& is_removed);

// A copy without the images that `is_removed` marks, in the order of
// Model::images, as if they had not been registered: frames go with their last
// image, cameras and rigs stay. Tracks must not hold them any more; throws
// std::invalid_argument unless there is one mark per image.
Model RemoveImages(const Model& model, const std::vector<char>& is_removed);

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
