#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/bridge/bridge.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"

namespace krot::internal {

// Version 2 proves a bound in true pixels (pixel_certificate.h). Version 1,
// which is still read, proves one of rows that are linearised at the
// observations.
inline constexpr int kCertificateVersion = 2;

// A certificate in terms of the model's ids: what is written to a file, and
// can be checked by anyone who has the model (docs/formats.md).
struct CertificateFile {
  struct SupportObservation {
    ImageId image_id = 0;
    uint32_t point2D_idx = 0;
    Point3DId point3D_id = 0;
    // Version 2: where the row is taken, in the camera's frame.
    Eigen::Vector3d bearing = Eigen::Vector3d::Zero();
    // Version 1: the row at the pixel's own ray.
    Eigen::Vector2d u = Eigen::Vector2d::Zero();
    Eigen::Matrix2d J = Eigen::Matrix2d::Zero();  // pixels
    double lambda = 0;
    Eigen::Vector2d y = Eigen::Vector2d::Zero();
  };

  // What must not move, and where it stands: its position is part of the proof.
  struct FixedImage {
    ImageId image_id = 0;
    Eigen::Vector3d translation;  // rig_from_world, of its frame
  };
  struct FixedPoint {
    Point3DId point3D_id = 0;
    Eigen::Vector3d xyz;
  };

  // Where a camera or a point is known to be, and the rows of that in the
  // support.
  struct Position {
    struct Row {
      Eigen::Vector3d apex;  // p of position_rows.h
      double lambda = 0;
      Eigen::Vector2d y = Eigen::Vector2d::Zero();
    };
    KnownPosition::Of of = KnownPosition::Of::kImage;
    uint64_t id = 0;  // the image's or the point's
    Ellipsoid region;
    std::vector<Row> rows;
  };

  int version = kCertificateVersion;
  Norm norm;
  double lower_bound = 0;  // true pixels; version 1: of the rows
  double rows_bound = 0;   // delta of the rows, pixels; version 2
  double defect = 0;       // of the rows' identities, relative
  std::string model_sha256;
  std::vector<SupportObservation> observations;
  // Of the support; the first image of a frame.
  std::vector<FixedImage> fixed_images;
  std::vector<FixedPoint> fixed_points;
  std::vector<Position> positions;
};

// The observations in its support in terms of the model's ids; `certificate`
// must be one of built.problem.
std::vector<CertificateFile::SupportObservation> DescribeSupport(
    const Model& model, const BuiltProblem& built,
    const PixelCertificate& certificate);

// The same of all of it.
CertificateFile DescribeCertificate(const Model& model,
                                    const BuiltProblem& built, Norm norm,
                                    const PixelCertificate& certificate);

// JSON. Doubles come back with the same bits.
std::string CertificateJson(const CertificateFile& file);

// The inverse. Throws ModelError, naming the file and the place in it, where a
// key is missing or a value is not of its type; says nothing about what the
// certificate proves.
CertificateFile ParseCertificate(const std::string& json,
                                 const std::string& file_name);
// The text of such a file; throws ModelError if it cannot be read or is empty.
std::string ReadCertificateText(const std::filesystem::path& path);
CertificateFile ReadCertificateFile(const std::filesystem::path& path);

}  // namespace krot::internal
