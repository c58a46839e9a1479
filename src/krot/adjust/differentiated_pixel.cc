#include "krot/adjust/differentiated_pixel.h"

#include <ceres/jet.h>

#include "krot/camera/models.h"

namespace krot {
namespace {

template <typename Camera>
class PixelOf {
 public:
  static DifferentiatedPixel Differentiate(const double* params,
                                           const Eigen::Vector2d& ray,
                                           double* J_params) {
    return J_params == nullptr
               ? DifferentiateBy<0>(params, ray, nullptr)
               : DifferentiateBy<kNumShape>(params, ray, J_params);
  }

 private:
  // Parameters of lens and distortion, which come last.
  static constexpr int kNumShape =
      Camera::Lens::kNumParams + Camera::Distortion::kNumParams;
  static constexpr int kNumParams = Camera::kNumParams;
  static_assert(kNumParams <= kMaxCameraParams);
  static constexpr int kNumFocal = kNumParams - kNumShape - 2;

  template <int kNumDerivatives>
  static DifferentiatedPixel DifferentiateBy(const double* params,
                                             const Eigen::Vector2d& ray,
                                             double* to) {
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
    DifferentiatedPixel result;
    result.pixel << fx * x.a + Camera::CenterX(params),
        fy * y.a + Camera::CenterY(params);
    result.J_ray.row(0) = fx * x.v.template head<2>();
    result.J_ray.row(1) = fy * y.v.template head<2>();
    if (to == nullptr) return result;

    Eigen::Map<Eigen::Matrix<double, 2, kNumParams, Eigen::RowMajor>> J_params(
        to);
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
    return result;
  }

  template <typename P, typename Jet>
  static void Shape(const P* params, const Jet& u, const Jet& v, Jet* x,
                    Jet* y) {
    Jet a, b;
    Camera::Lens::FromRay(Camera::LensParams(params), u, v, &a, &b);
    Camera::Distortion::Apply(Camera::DistortionParams(params), a, b, x, y);
  }
};

}  // namespace

DifferentiatedPixel DifferentiatePixel(int model_id, const double* params,
                                       const Eigen::Vector2d& ray,
                                       double* J_params) {
  return VisitCameraModel(model_id, [&](auto camera) {
    return PixelOf<decltype(camera)>::Differentiate(params, ray, J_params);
  });
}

}  // namespace krot
