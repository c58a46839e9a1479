#pragma once

#include <ceres/jet.h>
#include <Eigen/Core>

namespace krot {

// The pixel of a ray (u, v, 1) with its derivatives by the ray and by the
// camera's parameters: by forward differentiation through lens and distortion,
// behind which it is affine in focal lengths and principal point.
template <typename Camera>
struct DifferentiatedPixel {
  static constexpr int kNumParams = Camera::kNumParams;

  DifferentiatedPixel(const double* params, const Eigen::Vector2d& ray,
                      bool wants_params) {
    if (wants_params) {
      Differentiate<kNumShape>(params, ray);
    } else {
      Differentiate<0>(params, ray);
    }
  }

  Eigen::Vector2d pixel;
  Eigen::Matrix2d J_ray;
  Eigen::Matrix<double, 2, kNumParams> J_params;  // if wanted

 private:
  // Parameters of lens and distortion, which come last.
  static constexpr int kNumShape =
      Camera::Lens::kNumParams + Camera::Distortion::kNumParams;
  static constexpr int kNumFocal = kNumParams - kNumShape - 2;

  template <int kNumDerivatives>
  void Differentiate(const double* params, const Eigen::Vector2d& ray) {
    using Jet = ceres::Jet<double, 2 + kNumDerivatives>;
    const Jet u(ray.x(), 0);
    const Jet v(ray.y(), 1);
    Jet x, y;  // before focal length
    if constexpr (kNumDerivatives > 0) {
      Jet jets[kNumParams];
      for (int i = 0; i < kNumShape; ++i) {
        jets[kNumFocal + 2 + i] = Jet(params[kNumFocal + 2 + i], 2 + i);
      }
      Shape(jets, u, v, &x, &y);
    } else {
      Shape(params, u, v, &x, &y);
    }
    const double fx = Camera::FocalX(params), fy = Camera::FocalY(params);
    pixel << fx * x.a + Camera::CenterX(params),
        fy * y.a + Camera::CenterY(params);
    J_ray.row(0) = fx * x.v.template head<2>();
    J_ray.row(1) = fy * y.v.template head<2>();
    J_params.setZero();
    J_params(0, 0) = x.a;
    J_params(1, kNumFocal - 1) = y.a;
    J_params.template middleCols<2>(kNumFocal).setIdentity();
    if constexpr (kNumDerivatives > 0) {
      J_params.row(0).template tail<kNumShape>() =
          fx * x.v.template tail<kNumShape>();
      J_params.row(1).template tail<kNumShape>() =
          fy * y.v.template tail<kNumShape>();
    }
  }

  template <typename P, typename Jet>
  static void Shape(const P* params, const Jet& u, const Jet& v, Jet* x,
                    Jet* y) {
    Jet a, b;
    Camera::Lens::FromRay(Camera::LensParams(params), u, v, &a, &b);
    Camera::Distortion::Apply(Camera::DistortionParams(params), a, b, x, y);
  }
};

}  // namespace krot
