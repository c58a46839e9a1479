#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/numbers.h"
#include "krot/model.h"

namespace krot::internal {

// Figures that the reports on a precision derive from it.

// A test with 0.1 % false alarms detects an error of delta0 sigma / sqrt(r) in
// an observation with a probability of 80 % [Baarda 1968].
inline constexpr double kDelta0 = 4.13;

// An observation with its ids and figures.
struct NamedObservation {
  const ObservationPrecision* precision = nullptr;
  const Image* image = nullptr;
  uint32_t point2D_idx = 0;
  Point3DId point3D_id = 0;
  double error_px = 0;
  double w = kNaN;

  // The smallest detectable error of its worse coordinate, pixels.
  double DetectablePx(double sigma0_px) const {
    return kDelta0 * sigma0_px / std::sqrt(precision->redundancy.minCoeff());
  }
};

// The figures that are derived from a precision.
struct PrecisionFigures {
  // Keeps a reference to `precision`, which must be the model's.
  PrecisionFigures(const AdjustmentPrecision& precision, const Model& model);

  std::vector<NamedObservation> LargestResiduals() const;
  std::vector<NamedObservation> LargestW() const;
  std::vector<PointPrecision> SmallestAngles() const;
  // Root mean square of the determined points' standard deviations.
  Eigen::Vector3d RmsSigma() const;
  double MedianDetectablePx() const;

  std::vector<NamedObservation> all;
  int64_t num_observations = 0;
  std::map<int, int64_t> num_with_rays;
  double mean_angle_deg = 0;
  int64_t num_tested = 0;
  // Observations of which one direction or both are not controlled.
  int64_t num_uncontrolled = 0;
  double critical_w = kNaN;
  int64_t num_above = 0;

 private:
  // The observations with the largest `key`; those whose key is NaN are
  // skipped.
  template <typename Key>
  std::vector<NamedObservation> Worst(const Key& key) const;

  static constexpr size_t kWorstRows = 20;

  const AdjustmentPrecision& precision_;
};

// The standard deviations: square roots of the diagonal.
Eigen::VectorXd Deviations(const Eigen::MatrixXd& covariance);

// The names of a camera model's parameters: "f", "cx", "cy", "k".
std::vector<std::string> ParamNames(int model_id);

}  // namespace krot::internal
