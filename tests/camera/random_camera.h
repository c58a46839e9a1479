#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "krot/camera/camera_model.h"

namespace krot::internal {

// Parameters of a plausible camera of this model, some of them strongly
// distorted: drawn by the parameter's name, "f" to "sy1".
class RandomCamera {
 public:
  RandomCamera(int model_id, std::mt19937* random)
      : model_id_(model_id), random_(random) {
    std::string_view names = FindCameraModel(model_id)->param_names;
    while (!names.empty()) {
      const size_t comma = std::min(names.find(", "), names.size());
      params_.push_back(Draw(names.substr(0, comma)));
      names.remove_prefix(std::min(comma + 2, names.size()));
    }
  }

  const std::vector<double>& params() const { return params_; }

  Eigen::Vector2d Project(const Eigen::Vector2d& u) const {
    return ProjectRay({model_id_, params_.data()}, u);
  }

  // d pixel / d u by central differences of ProjectRay.
  Eigen::Matrix2d NumericJacobian(const Eigen::Vector2d& u) const {
    const double step = 1e-6 * (1 + u.norm());
    Eigen::Matrix2d J;
    for (int i = 0; i < 2; ++i) {
      const Eigen::Vector2d h = step * Eigen::Vector2d::Unit(i);
      J.col(i) = (Project(u + h) - Project(u - h)) / (2 * step);
    }
    return J;
  }

  // The smallest det J on 400 points of the segment from the axis to u, as a
  // share of that on the axis; NaN if one of them is not finite.
  double SmallestDeterminant(const Eigen::Vector2d& u) const {
    const double on_axis = Determinant(Eigen::Vector2d::Zero());
    double smallest = 1;
    for (int i = 1; i <= 400; ++i) {
      const double share = Determinant(i / 400.0 * u) / on_axis;
      if (!std::isfinite(share)) return NAN;
      smallest = std::min(smallest, share);
    }
    return smallest;
  }

 private:
  double Determinant(const Eigen::Vector2d& u) const {
    const Eigen::Matrix2d J = NumericJacobian(u);
    return J(0, 0) * J(1, 1) - J(0, 1) * J(1, 0);
  }

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(*random_);
  }

  double Draw(std::string_view name) {
    if (name[0] == 'f') return Uniform(300, 5000);
    if (name[0] == 'c') return Uniform(200, 2500);
    if (name == "w") return Uniform(2000, 8000);  // EQUIRECTANGULAR
    if (name == "h") return Uniform(1000, 4000);
    if (name == "omega") return Uniform(0.3, 1.5);
    if (name == "alpha") return Uniform(0.1, 0.9);
    if (name == "beta") return Uniform(0.5, 2);
    // FULL_OPENCV's denominator stays positive.
    if (name == "k4" || name == "k5" || name == "k6") return Uniform(0, 0.3);
    if (name[0] == 'k') return Uniform(-0.3, 0.3);
    return Uniform(-0.01, 0.01);  // tangential and thin prism
  }

  int model_id_;
  std::mt19937* random_;
  std::vector<double> params_;
};

// A ray up to `max_radius` off the axis on z = 1.
inline Eigen::Vector2d RandomRay(double max_radius, std::mt19937* random) {
  std::uniform_real_distribution<double> unit(0, 1);
  const double radius = max_radius * unit(*random);
  const double angle = 6.283185307179586 * unit(*random);
  return radius * Eigen::Vector2d(std::cos(angle), std::sin(angle));
}

inline std::vector<int> ImagePlaneModelIds() {
  std::vector<int> ids;
  for (const CameraModelInfo& info : CameraModels()) {
    if (info.has_image_plane) ids.push_back(info.id);
  }
  return ids;
}

// A unit vector up to `max_angle` off the axis.
inline Eigen::Vector3d RandomBearing(double max_angle, std::mt19937* random) {
  std::uniform_real_distribution<double> unit(0, 1);
  const double theta = max_angle * unit(*random);
  const double phi = 6.283185307179586 * unit(*random);
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
          std::cos(theta)};
}

inline std::string ModelName(int model_id) {
  return std::string(FindCameraModel(model_id)->name);
}

}  // namespace krot::internal
