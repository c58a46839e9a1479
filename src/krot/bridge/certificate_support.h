#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "krot/bridge/bridge.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model/model.h"
#include "krot/proof/certificate_check.h"

namespace krot {

// An observation that, with the others of its certificate, sets the maximum.
struct SupportObservation {
  ImageId image_id = 0;
  std::string image_name;
  uint32_t point2D_idx = 0;
  Point3DId point3D_id = 0;
  double multiplier = 0;  // lambda, of a sum of 1
  // That of the problem's row, pixels: the true error where the row was taken
  // at the estimate. Infinite behind the camera.
  double error_px = 0;
  bool has_image_twice = false;  // its track, in the problem
};

// A known position in the support: with all others and the observations it sets
// the maximum.
struct SupportPosition {
  // Whose it is: an image's or, without a name, a point's.
  ImageId image_id = 0;
  std::string image_name;
  Point3DId point3D_id = 0;
  double share = 0;     // of what the positions' rows pull in all
  double distance = 0;  // of the camera or point from it, scene units
  double radius = 0;    // in that direction

  // "a.jpg" or "3D point 12".
  std::string Name() const {
    return image_name.empty() ? "3D point " + std::to_string(point3D_id)
                              : image_name;
  }
};

// Those of a certificate, whose rows those of built.problem are, with the
// largest share first.
std::vector<SupportPosition> ListSupportPositions(
    const Model& model, const BuiltProblem& built, const Estimate& estimate,
    const PixelCertificate& certificate);

// The observations in the support of a certificate of built.problem, worst
// first.
std::vector<SupportObservation> ListSupport(const Model& model,
                                            const BuiltProblem& built,
                                            const Estimate& estimate, Norm norm,
                                            const Certificate& certificate);

}  // namespace krot
