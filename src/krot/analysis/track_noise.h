#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/analysis/noise.h"
#include "krot/model.h"

namespace krot::internal {

// All tracks of a model, each fitted by itself with the cameras as they stand,
// and which of their observations take part.
class TrackNoise {
 public:
  // Keeps references. Every observation takes part whose image has a pose.
  TrackNoise(const Model& model, const std::vector<double>& relative_sigmas);

  // Moves point k to the least squares of those of its observations that take
  // part and see it, and fills in what that says of them. Different points may
  // be fitted at the same time.
  void Fit(int64_t k);

  // Of what takes part and sees its point all but w, which needs sigma. w is
  // infinite for what does not see it, NaN for the rest.
  const std::vector<ObservationNoise>& observations() const {
    return observations_;
  }
  void SetW(uint64_t e, double w) { observations_[e].w = w; }
  // w^2 sigma^2: the sum over controlled directions, squared pixels.
  double SquaredError(uint64_t e) const { return squared_errors_[e]; }

  bool TakesPart(uint64_t e) const { return takes_part_[e]; }
  void Remove(uint64_t e);

  // The error of any observation, pixels, where its point lies now; not finite
  // where that is not seen.
  Eigen::Vector2d ErrorOf(uint64_t e) const;
  // Where point k came to lie; the model's where that is at infinity, or the
  // point was not fitted.
  Eigen::Vector3d Point(int64_t k) const;

 private:
  struct View {
    const Camera* camera = nullptr;  // null: without a pose
    const Image* image = nullptr;
    Eigen::Matrix3d cam_from_world_rotation;
    Eigen::Vector3d center;
  };
  // Divided by the observation's relative sigma.
  struct Row {
    Eigen::Vector2d error;
    Eigen::Matrix<double, 2, 3> J;  // by the tangent of the sphere
  };
  class Track;

  const Model& model_;
  const std::vector<double>& relative_sigmas_;
  std::vector<View> views_;        // as Model::images
  std::vector<int32_t> image_of_;  // by track element
  std::vector<int32_t> point_of_;
  std::vector<char> takes_part_;
  std::vector<ObservationNoise> observations_;
  std::vector<double> squared_errors_;
  std::vector<Eigen::Vector4d> points_;  // homogeneous
};

}  // namespace krot::internal
