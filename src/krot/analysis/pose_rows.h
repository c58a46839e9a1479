#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/analysis/noise.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {

// An observation at the least squares of its track.
struct PoseRow {
  uint64_t element = 0;  // in Model::track_elements
  int32_t image = 0;
  Eigen::Vector3d x_cam;
  Eigen::Vector2d error;  // projected - measured, pixels
  // By the camera's rotation (from the left) and centre. The derivative by the
  // point is minus that by the centre.
  Eigen::Matrix<double, 2, 6> F;
};

// The observations of each track that `noise` tests, as it fits them.
class PoseRows {
 public:
  // Keeps references. Requires a valid model. O(observations).
  PoseRows(const Model& model, const ModelNoise& noise);

  // Of point k; empty if fewer than two are left.
  std::vector<PoseRow> Of(size_t k) const;

  const std::vector<ImageGeometry>& geometries() const { return geometries_; }

 private:
  const Model& model_;
  const ModelNoise& noise_;
  const std::vector<ImageGeometry> geometries_;
  const std::vector<int32_t> image_of_;  // by track element
  std::vector<double> nearest_;  // distance of a point, by image; scene units
};

}  // namespace krot::internal
