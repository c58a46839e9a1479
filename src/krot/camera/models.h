#pragma once

#include <stdexcept>
#include <string>

#include "krot/camera/distortion.h"
#include "krot/camera/lens.h"

namespace krot::internal {

// COLMAP's camera models. Each consists of a lens (lens.h), a distortion
// (distortion.h) and one or two focal lengths:
//
//   ray (u, v, 1) --lens--> (a, b) --distortion--> (x, y) --focal--> pixel
//   pixel = (fx x + cx, fy y + cy)
//
// Parameters are in COLMAP's order: focal length(s), cx, cy, then those of the
// lens or of the distortion (no model has both). P is the type of parameters:
// double, or T where parameters are differentiated, too.
template <int id, int kNumFocal, typename LensType, typename DistortionType>
struct ImagePlaneModel {
  static constexpr int kId = id;  // COLMAP's
  using Lens = LensType;
  using Distortion = DistortionType;
  static constexpr int kNumParams =
      kNumFocal + 2 + Lens::kNumParams + Distortion::kNumParams;

  template <typename P>
  static const P& FocalX(const P* params) {
    return params[0];
  }
  template <typename P>
  static const P& FocalY(const P* params) {
    return params[kNumFocal - 1];
  }
  template <typename P>
  static const P& CenterX(const P* params) {
    return params[kNumFocal];
  }
  template <typename P>
  static const P& CenterY(const P* params) {
    return params[kNumFocal + 1];
  }
  template <typename P>
  static const P* LensParams(const P* params) {
    return params + kNumFocal + 2;
  }
  template <typename P>
  static const P* DistortionParams(const P* params) {
    return params + kNumFocal + 2 + Lens::kNumParams;
  }

  // The pixel (x, y) of the ray (u, v, 1).
  template <typename P, typename T>
  static void Project(const P* params, const T& u, const T& v, T* x, T* y) {
    T a, b;
    Lens::FromRay(LensParams(params), u, v, &a, &b);
    Distortion::Apply(DistortionParams(params), a, b, x, y);
    *x = *x * FocalX(params) + CenterX(params);
    *y = *y * FocalY(params) + CenterY(params);
  }

  // The pixel of the direction (X, Y, Z), which may be more than 90 degrees off
  // the axis if the lens sees it.
  template <typename P, typename T>
  static void ProjectPoint(const P* params, const T& X, const T& Y, const T& Z,
                           T* x, T* y) {
    T a, b;
    Lens::FromPoint(LensParams(params), X, Y, Z, &a, &b);
    Distortion::Apply(DistortionParams(params), a, b, x, y);
    *x = *x * FocalX(params) + CenterX(params);
    *y = *y * FocalY(params) + CenterY(params);
  }

  // ProjectPoint minus (x, y).
  template <typename P, typename T>
  static void ErrorAt(const P* params, double x, double y, const T& X,
                      const T& Y, const T& Z, T* error_x, T* error_y) {
    ProjectPoint(params, X, Y, Z, error_x, error_y);
    *error_x = *error_x - x;
    *error_y = *error_y - y;
  }

  static bool Sees(const double* params, double X, double Y, double Z) {
    return Lens::Sees(LensParams(params), X, Y, Z);
  }
};

using SimplePinhole = ImagePlaneModel<0, 1, PerspectiveLens, NoDistortion>;
using Pinhole = ImagePlaneModel<1, 2, PerspectiveLens, NoDistortion>;
using SimpleRadial =
    ImagePlaneModel<2, 1, PerspectiveLens, RadialDistortion<1>>;
using Radial = ImagePlaneModel<3, 1, PerspectiveLens, RadialDistortion<2>>;
using OpenCv = ImagePlaneModel<4, 2, PerspectiveLens, BrownDistortion>;
using OpenCvFisheye =
    ImagePlaneModel<5, 2, EquidistantLens, RadialDistortion<4>>;
using FullOpenCv = ImagePlaneModel<6, 2, PerspectiveLens, RationalDistortion>;
using Fov = ImagePlaneModel<7, 2, FovLens, NoDistortion>;
using SimpleRadialFisheye =
    ImagePlaneModel<8, 1, EquidistantLens, RadialDistortion<1>>;
using RadialFisheye =
    ImagePlaneModel<9, 1, EquidistantLens, RadialDistortion<2>>;
using ThinPrismFisheye =
    ImagePlaneModel<10, 2, EquidistantLens, ThinPrismDistortion>;
using RadTanThinPrismFisheye =
    ImagePlaneModel<11, 2, EquidistantLens, RadTanThinPrismDistortion>;
using SimpleDivision = ImagePlaneModel<12, 1, DivisionLens, NoDistortion>;
using Division = ImagePlaneModel<13, 2, DivisionLens, NoDistortion>;
using SimpleFisheye = ImagePlaneModel<14, 1, EquidistantLens, NoDistortion>;
using Fisheye = ImagePlaneModel<15, 2, EquidistantLens, NoDistortion>;
using Eucm = ImagePlaneModel<16, 2, EucmLens, NoDistortion>;

// The sphere of directions on a w x h panorama, which has no image plane z = 1:
//   pixel = (w (1/2 + azimuth / 2 pi), h (1/2 + elevation / pi)),
// azimuth the angle of (Z, X), elevation that of (|(X, Z)|, Y).
struct Equirectangular {
  static constexpr int kId = 17;
  static constexpr int kNumParams = 2;

  template <typename P, typename T>
  static void ProjectPoint(const P* params, const T& X, const T& Y, const T& Z,
                           T* x, T* y) {
    using std::atan2;
    using std::sqrt;
    *x = (atan2(X, Z) * (0.5 / kPi) + 0.5) * params[0];
    *y = (atan2(Y, T(sqrt(T(X * X + Z * Z)))) * (1 / kPi) + 0.5) * params[1];
  }

  // ProjectPoint minus (x, y), by the shorter way round. Azimuths are measured
  // from that of x, so that there is no jump at the seam.
  template <typename P, typename T>
  static void ErrorAt(const P* params, double x, double y, const T& X,
                      const T& Y, const T& Z, T* error_x, T* error_y) {
    using std::cos;
    using std::sin;
    const P azimuth = (x / params[0] - 0.5) * (2 * kPi);
    const P c = cos(azimuth);
    const P s = sin(azimuth);
    ProjectPoint(params, T(X * c - Z * s), Y, T(Z * c + X * s), error_x,
                 error_y);
    *error_x = *error_x - params[0] * 0.5;
    *error_y = *error_y - y;
  }

  static bool Sees(const double*, double, double, double) { return true; }
};

template <typename First, typename... Rest, typename Visitor>
decltype(auto) VisitFirst(int model_id, Visitor& visitor) {
  if (model_id == First::kId) return visitor(First{});
  if constexpr (sizeof...(Rest) > 0) {
    return VisitFirst<Rest...>(model_id, visitor);
  } else {
    throw std::invalid_argument(
        "model_id = " + std::to_string(model_id) +
        ", must be a camera model of COLMAP with an image plane");
  }
}

// visitor(Model{}) for the model of this id, so that a loop over observations
// is compiled for each model and dispatches once per image. Throws
// std::invalid_argument for an id that is unknown or has no image plane.
template <typename Visitor>
decltype(auto) VisitCameraModel(int model_id, Visitor&& visitor) {
  return VisitFirst<SimplePinhole, Pinhole, SimpleRadial, Radial, OpenCv,
                    OpenCvFisheye, FullOpenCv, Fov, SimpleRadialFisheye,
                    RadialFisheye, ThinPrismFisheye, RadTanThinPrismFisheye,
                    SimpleDivision, Division, SimpleFisheye, Fisheye, Eucm>(
      model_id, visitor);
}

// The same, including EQUIRECTANGULAR.
template <typename Visitor>
decltype(auto) VisitEveryCameraModel(int model_id, Visitor&& visitor) {
  if (model_id == Equirectangular::kId) return visitor(Equirectangular{});
  return VisitCameraModel(model_id, visitor);
}

}  // namespace krot::internal
