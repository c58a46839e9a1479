#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/bridge/bridge.h"
#include "krot/minimax/norm.h"
#include "krot/model/model.h"
#include "krot/proof/certificate_check.h"

namespace krot {

// A certificate in terms of the model's ids: what is written to a file, and
// can be checked by anyone who has the model (docs/formats.md).
struct CertificateFile {
  struct SupportObservation {
    ImageId image_id = 0;
    uint32_t point2D_idx = 0;
    Point3DId point3D_id = 0;
    Eigen::Vector2d u = Eigen::Vector2d::Zero();
    Eigen::Matrix2d J = Eigen::Matrix2d::Zero();  // pixels
    double lambda = 0;
    Eigen::Vector2d y = Eigen::Vector2d::Zero();
  };

  Norm norm;
  double lower_bound = 0;  // linearised pixels
  double defect = 0;       // relative
  std::string model_sha256;
  std::vector<SupportObservation> observations;
};

inline constexpr int kCertificateVersion = 1;

// `certificate` must be one of built.problem.
CertificateFile DescribeCertificate(const Model& model,
                                    const BuiltProblem& built, Norm norm,
                                    const Certificate& certificate);

// JSON. Doubles come back with the same bits.
std::string CertificateJson(const CertificateFile& file);

// The inverse. Throws ModelError, naming the file and the place in it, where a
// key is missing or a value is not of its type; says nothing about what the
// certificate proves.
CertificateFile ParseCertificate(const std::string& json,
                                 const std::string& file_name);
CertificateFile ReadCertificateFile(const std::filesystem::path& path);

}  // namespace krot
