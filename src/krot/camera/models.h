#pragma once

#include <cmath>
#include <stdexcept>
#include <string>

#include "krot/camera/lens.h"

namespace krot::internal {

// A distortion D maps a point (a, b) of the lens plane to (x, y) in the same
// units, before focal length and principal point. It keeps the centre:
// D(0) = 0 and D'(0) = I.
//
//   Apply(k, a, b, &x, &y)    for any scalar; uses only + - * /;
//   DeviationBound(k, r)      an upper bound on the norm of D'(q) - I for all
//                             |q| <= r. Below 1, D is injective on that disc
//                             and det D' > 0 there (I + E with |E| < 1).
//
// `k` points at kNumParams parameters. s stands for a^2 + b^2.

// k[0] s + k[1] s^2 + ... + k[kDegree - 1] s^kDegree
template <int kDegree, typename P, typename T>
T RadialSeries(const P* k, const T& s) {
  T sum = s * k[kDegree - 1];
  for (int i = kDegree - 2; i >= 0; --i) sum = s * (sum + k[i]);
  return sum;
}

// Sum of (2i + 1) |k_i| r^2i: bounds both eigenvalues of the derivative of
// q * RadialSeries, which are the series R(s) and R(s) + 2 s R'(s).
template <int kDegree>
double RadialDeviationBound(const double* k, double r) {
  double sum = 0;
  double power = 1;
  for (int i = 0; i < kDegree; ++i) {
    power *= r * r;
    sum += (2 * i + 3) * std::abs(k[i]) * power;
  }
  return sum;
}

// Decentering [Brown 1966], in OpenCV's order of p1 and p2:
//   x += 2 p1 a b + p2 (s + 2 a^2),  y += 2 p2 a b + p1 (s + 2 b^2)
template <typename P, typename T>
void AddTangential(const P& p1, const P& p2, const T& a, const T& b, T* x,
                   T* y) {
  const T s = a * a + b * b;
  const T ab2 = a * b * 2.0;
  *x = *x + ab2 * p1 + (s + a * a * 2.0) * p2;
  *y = *y + ab2 * p2 + (s + b * b * 2.0) * p1;
}

// Norm of the derivative: for p1 alone its eigenvalues are 4b +- 2r.
inline double TangentialDeviationBound(double p1, double p2, double r) {
  return 6 * (std::abs(p1) + std::abs(p2)) * r;
}

// (x, y) = (a, b)
struct NoDistortion {
  static constexpr int kNumParams = 0;

  template <typename P, typename T>
  static void Apply(const P*, const T& a, const T& b, T* x, T* y) {
    *x = a;
    *y = b;
  }

  static double DeviationBound(const double*, double) { return 0; }
};

// (x, y) = (a, b) (1 + k1 s + k2 s^2 + ...)
template <int kDegree>
struct RadialDistortion {
  static constexpr int kNumParams = kDegree;

  template <typename P, typename T>
  static void Apply(const P* k, const T& a, const T& b, T* x, T* y) {
    const T scale = 1.0 + RadialSeries<kDegree>(k, T(a * a + b * b));
    *x = a * scale;
    *y = b * scale;
  }

  static double DeviationBound(const double* k, double r) {
    return RadialDeviationBound<kDegree>(k, r);
  }
};

// Radial k1, k2 and tangential p1, p2.
struct BrownDistortion {
  static constexpr int kNumParams = 4;  // k1 k2 p1 p2

  template <typename P, typename T>
  static void Apply(const P* k, const T& a, const T& b, T* x, T* y) {
    RadialDistortion<2>::Apply(k, a, b, x, y);
    AddTangential(k[2], k[3], a, b, x, y);
  }

  static double DeviationBound(const double* k, double r) {
    return RadialDeviationBound<2>(k, r) +
           TangentialDeviationBound(k[2], k[3], r);
  }
};

// A rational radial term and the tangential one:
//   (a, b) (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)
// computed as 1 + (numerator - denominator) / denominator, which loses fewer
// digits, and less width on intervals, where both are large.
struct RationalDistortion {
  static constexpr int kNumParams = 8;  // k1 k2 p1 p2 k3 k4 k5 k6

  template <typename P, typename T>
  static void Apply(const P* k, const T& a, const T& b, T* x, T* y) {
    const T s = a * a + b * b;
    const P excess[3] = {k[0] - k[5], k[1] - k[6], k[4] - k[7]};
    const T scale =
        1.0 + RadialSeries<3>(excess, s) / (1.0 + RadialSeries<3>(k + 5, s));
    *x = a * scale;
    *y = b * scale;
    AddTangential(k[2], k[3], a, b, x, y);
  }

  // With N, M numerator and denominator, n and m bounds on |N - M| and
  // |M - 1|, n' and m' bounds on 2 s |N' - M'| and 2 s |M'|, the eigenvalues
  // of the radial part minus 1 are (N - M)/M and that plus
  // 2 s ((N' - M') M - (N - M) M') / M^2.
  static double DeviationBound(const double* k, double r) {
    const double excess[3] = {k[0] - k[5], k[1] - k[6], k[4] - k[7]};
    double n = 0, m = 0, n_slope = 0, m_slope = 0, power = 1;
    for (int i = 0; i < 3; ++i) {
      power *= r * r;
      const double n_term = std::abs(excess[i]) * power;
      const double m_term = std::abs(k[5 + i]) * power;
      n += n_term;
      m += m_term;
      n_slope += (2 * i + 2) * n_term;
      m_slope += (2 * i + 2) * m_term;
    }
    if (!(m < 1)) return HUGE_VAL;
    return n / (1 - m) +
           (n_slope * (1 + m) + n * m_slope) / ((1 - m) * (1 - m)) +
           TangentialDeviationBound(k[2], k[3], r);
  }
};

// Radial, tangential and thin prism [Weng, Cohen, Herniou 1992]:
//   x += sx1 s,  y += sy1 s
struct ThinPrismDistortion {
  static constexpr int kNumParams = 8;  // k1 k2 p1 p2 k3 k4 sx1 sy1

  template <typename P, typename T>
  static void Apply(const P* k, const T& a, const T& b, T* x, T* y) {
    const P radial[4] = {k[0], k[1], k[4], k[5]};
    RadialDistortion<4>::Apply(radial, a, b, x, y);
    AddTangential(k[2], k[3], a, b, x, y);
    const T s = a * a + b * b;
    *x = *x + s * k[6];
    *y = *y + s * k[7];
  }

  static double DeviationBound(const double* k, double r) {
    const double radial[4] = {k[0], k[1], k[4], k[5]};
    return RadialDeviationBound<4>(radial, r) +
           TangentialDeviationBound(k[2], k[3], r) +
           2 * std::hypot(k[6], k[7]) * r;
  }
};

// Project Aria's "Fisheye624": tangential and thin prism terms act on the
// radially distorted point (a', b'), with s' = a'^2 + b'^2:
//   x = a' + 2 p1 a' b' + p0 (s' + 2 a'^2) + s0 s' + s1 s'^2
//   y = b' + 2 p0 a' b' + p1 (s' + 2 b'^2) + s2 s' + s3 s'^2
struct RadTanThinPrismDistortion {
  static constexpr int kNumParams = 12;  // k0..k5 p0 p1 s0..s3

  template <typename P, typename T>
  static void Apply(const P* k, const T& a, const T& b, T* x, T* y) {
    T radial_a, radial_b;
    RadialDistortion<6>::Apply(k, a, b, &radial_a, &radial_b);
    *x = radial_a;
    *y = radial_b;
    AddTangential(k[7], k[6], radial_a, radial_b, x, y);
    const T s = radial_a * radial_a + radial_b * radial_b;
    *x = *x + s * (s * k[9] + k[8]);
    *y = *y + s * (s * k[11] + k[10]);
  }

  // D = T o R, so D' - I = (T' - I) R' + (R' - I); R stays in the disc of
  // radius (1 + radial) r.
  static double DeviationBound(const double* k, double r) {
    const double radial = RadialDeviationBound<6>(k, r);
    const double reach = (1 + radial) * r;
    const double outer = TangentialDeviationBound(k[6], k[7], reach) +
                         2 * std::hypot(k[8], k[10]) * reach +
                         4 * std::hypot(k[9], k[11]) * reach * reach * reach;
    return outer * (1 + radial) + radial;
  }
};

// COLMAP's camera models. Each consists of a lens (lens.h), a distortion and
// one or two focal lengths:
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
  using Lens = void;
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
