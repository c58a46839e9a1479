#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "krot/convert/certificate_file.h"
#include "krot/math/norm.h"

namespace krot::internal {

// What the files of certificates, conflicts and baselines have in common.

using CertificateFileJson = nlohmann::ordered_json;

// Reads values from a parsed file; every error is a ModelError that names the
// file and the place.
class JsonReader {
 public:
  using Json = CertificateFileJson;

  explicit JsonReader(std::string file_name);

  [[noreturn]] void Fail(const std::string& place, const Json& found,
                         const std::string& expected) const;
  const Json& Member(const Json& object, const std::string& place,
                     const char* key) const;
  double Number(const Json& value, const std::string& place) const;
  uint64_t Id(const Json& value, const std::string& place,
              uint64_t largest) const;
  std::string String(const Json& value, const std::string& place) const;
  const Json& Array(const Json& value, const std::string& place) const;
  Eigen::Vector3d Triple(const Json& value, const std::string& place) const;
  // QW QX QY QZ.
  Eigen::Quaterniond Quaternion(const Json& value,
                                const std::string& place) const;
  Eigen::Vector2d Pair(const Json& value, const std::string& place) const;
  Norm ReadNorm(const Json& value) const;
  // The support of a certificate.
  std::vector<CertificateFile::SupportObservation> ReadSupport(
      const Json& observations, const std::string& place) const;
  // Sets the file's fixed images and points.
  void ReadFixed(const Json& fixed, CertificateFile* file) const;
  // Sets the file's known positions.
  void ReadPositions(const Json& positions, CertificateFile* file) const;

 private:
  const std::string file_name_;
};

CertificateFileJson NormJson(Norm norm);
CertificateFileJson FixedJson(const CertificateFile& file);
CertificateFileJson PositionsJson(const CertificateFile& file);
CertificateFileJson SupportJson(
    const std::vector<CertificateFile::SupportObservation>& observations);

}  // namespace krot::internal
