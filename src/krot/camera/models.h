#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

#include "krot/camera/distortion.h"
#include "krot/camera/lens.h"
#include "krot/camera/root_lens.h"

namespace krot::internal {

// COLMAP's camera models, each a lens (lens.h), a distortion (distortion.h)
// and one or two focal lengths:
//
//   ray (u, v, 1) --lens--> (a, b) --distortion--> (x, y) --focal--> pixel
//   pixel = (fx x + cx, fy y + cy)
//
// Parameters stand in COLMAP's order: focal length(s), cx, cy, then those of
// the lens or of the distortion (no model has both). P is double, or T where
// the parameters themselves are differentiated.
template <int kNumFocal, typename LensType, typename DistortionType>
struct ImagePlaneModel {
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

  // That pixel less (x, y).
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

struct SimplePinhole : ImagePlaneModel<1, PerspectiveLens, NoDistortion> {
  static constexpr int kId = 0;
  static constexpr std::string_view kName = "SIMPLE_PINHOLE";
  static constexpr std::string_view kParamNames = "f, cx, cy";
};

struct Pinhole : ImagePlaneModel<2, PerspectiveLens, NoDistortion> {
  static constexpr int kId = 1;
  static constexpr std::string_view kName = "PINHOLE";
  static constexpr std::string_view kParamNames = "fx, fy, cx, cy";
};

struct SimpleRadial : ImagePlaneModel<1, PerspectiveLens, RadialDistortion<1>> {
  static constexpr int kId = 2;
  static constexpr std::string_view kName = "SIMPLE_RADIAL";
  static constexpr std::string_view kParamNames = "f, cx, cy, k";
};

struct Radial : ImagePlaneModel<1, PerspectiveLens, RadialDistortion<2>> {
  static constexpr int kId = 3;
  static constexpr std::string_view kName = "RADIAL";
  static constexpr std::string_view kParamNames = "f, cx, cy, k1, k2";
};

struct OpenCv : ImagePlaneModel<2, PerspectiveLens, BrownDistortion> {
  static constexpr int kId = 4;
  static constexpr std::string_view kName = "OPENCV";
  static constexpr std::string_view kParamNames =
      "fx, fy, cx, cy, k1, k2, p1, p2";
};

struct OpenCvFisheye
    : ImagePlaneModel<2, EquidistantLens, RadialDistortion<4>> {
  static constexpr int kId = 5;
  static constexpr std::string_view kName = "OPENCV_FISHEYE";
  static constexpr std::string_view kParamNames =
      "fx, fy, cx, cy, k1, k2, k3, k4";
};

struct FullOpenCv : ImagePlaneModel<2, PerspectiveLens, RationalDistortion> {
  static constexpr int kId = 6;
  static constexpr std::string_view kName = "FULL_OPENCV";
  static constexpr std::string_view kParamNames =
      "fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6";
};

struct Fov : ImagePlaneModel<2, FovLens, NoDistortion> {
  static constexpr int kId = 7;
  static constexpr std::string_view kName = "FOV";
  static constexpr std::string_view kParamNames = "fx, fy, cx, cy, omega";
};

struct SimpleRadialFisheye
    : ImagePlaneModel<1, EquidistantLens, RadialDistortion<1>> {
  static constexpr int kId = 8;
  static constexpr std::string_view kName = "SIMPLE_RADIAL_FISHEYE";
  static constexpr std::string_view kParamNames = "f, cx, cy, k";
};

struct RadialFisheye
    : ImagePlaneModel<1, EquidistantLens, RadialDistortion<2>> {
  static constexpr int kId = 9;
  static constexpr std::string_view kName = "RADIAL_FISHEYE";
  static constexpr std::string_view kParamNames = "f, cx, cy, k1, k2";
};

struct ThinPrismFisheye
    : ImagePlaneModel<2, EquidistantLens, ThinPrismDistortion> {
  static constexpr int kId = 10;
  static constexpr std::string_view kName = "THIN_PRISM_FISHEYE";
  static constexpr std::string_view kParamNames =
      "fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1";
};

struct RadTanThinPrismFisheye
    : ImagePlaneModel<2, EquidistantLens, RadTanThinPrismDistortion> {
  static constexpr int kId = 11;
  static constexpr std::string_view kName = "RAD_TAN_THIN_PRISM_FISHEYE";
  static constexpr std::string_view kParamNames =
      "fx, fy, cx, cy, k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3";
};

struct SimpleDivision : ImagePlaneModel<1, DivisionLens, NoDistortion> {
  static constexpr int kId = 12;
  static constexpr std::string_view kName = "SIMPLE_DIVISION";
  static constexpr std::string_view kParamNames = "f, cx, cy, k";
};

struct Division : ImagePlaneModel<2, DivisionLens, NoDistortion> {
  static constexpr int kId = 13;
  static constexpr std::string_view kName = "DIVISION";
  static constexpr std::string_view kParamNames = "fx, fy, cx, cy, k";
};

struct SimpleFisheye : ImagePlaneModel<1, EquidistantLens, NoDistortion> {
  static constexpr int kId = 14;
  static constexpr std::string_view kName = "SIMPLE_FISHEYE";
  static constexpr std::string_view kParamNames = "f, cx, cy";
};

struct Fisheye : ImagePlaneModel<2, EquidistantLens, NoDistortion> {
  static constexpr int kId = 15;
  static constexpr std::string_view kName = "FISHEYE";
  static constexpr std::string_view kParamNames = "fx, fy, cx, cy";
};

struct Eucm : ImagePlaneModel<2, EucmLens, NoDistortion> {
  static constexpr int kId = 16;
  static constexpr std::string_view kName = "EUCM";
  static constexpr std::string_view kParamNames = "fx, fy, cx, cy, alpha, beta";
};

// The sphere of directions on a w x h panorama, which has no image plane z = 1:
//   pixel = (w (1/2 + azimuth / 2 pi), h (1/2 + elevation / pi)),
// azimuth the angle of (Z, X), elevation that of (|(X, Z)|, Y).
struct Equirectangular {
  static constexpr int kId = 17;
  static constexpr std::string_view kName = "EQUIRECTANGULAR";
  static constexpr std::string_view kParamNames = "w, h";
  static constexpr int kNumParams = 2;

  template <typename P, typename T>
  static void ProjectPoint(const P* params, const T& X, const T& Y, const T& Z,
                           T* x, T* y) {
    using std::atan2;
    using std::sqrt;
    *x = (atan2(X, Z) * (0.5 / kPi) + 0.5) * params[0];
    *y = (atan2(Y, T(sqrt(T(X * X + Z * Z)))) * (1 / kPi) + 0.5) * params[1];
  }

  // That pixel less (x, y), the shorter way round: with the azimuth taken from
  // that of x, nothing jumps at the seam.
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

// visitor(Model{}) for the model of this id, so that a loop over observations
// is compiled for each model and dispatches once per image. Throws
// std::invalid_argument for an id that is unknown or has no image plane.
template <typename Visitor>
decltype(auto) VisitCameraModel(int model_id, Visitor&& visitor) {
  switch (model_id) {
    case SimplePinhole::kId:
      return visitor(SimplePinhole{});
    case Pinhole::kId:
      return visitor(Pinhole{});
    case SimpleRadial::kId:
      return visitor(SimpleRadial{});
    case Radial::kId:
      return visitor(Radial{});
    case OpenCv::kId:
      return visitor(OpenCv{});
    case OpenCvFisheye::kId:
      return visitor(OpenCvFisheye{});
    case FullOpenCv::kId:
      return visitor(FullOpenCv{});
    case Fov::kId:
      return visitor(Fov{});
    case SimpleRadialFisheye::kId:
      return visitor(SimpleRadialFisheye{});
    case RadialFisheye::kId:
      return visitor(RadialFisheye{});
    case ThinPrismFisheye::kId:
      return visitor(ThinPrismFisheye{});
    case RadTanThinPrismFisheye::kId:
      return visitor(RadTanThinPrismFisheye{});
    case SimpleDivision::kId:
      return visitor(SimpleDivision{});
    case Division::kId:
      return visitor(Division{});
    case SimpleFisheye::kId:
      return visitor(SimpleFisheye{});
    case Fisheye::kId:
      return visitor(Fisheye{});
    case Eucm::kId:
      return visitor(Eucm{});
    default:
      throw std::invalid_argument(
          "model_id = " + std::to_string(model_id) +
          ", must be a camera model of COLMAP with an image plane");
  }
}

// The same, EQUIRECTANGULAR included.
template <typename Visitor>
decltype(auto) VisitEveryCameraModel(int model_id, Visitor&& visitor) {
  if (model_id == Equirectangular::kId) return visitor(Equirectangular{});
  return VisitCameraModel(model_id, visitor);
}

}  // namespace krot::internal
