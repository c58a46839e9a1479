#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "krot/context.h"
#include "krot/convert/certificate_file.h"
#include "krot/geometry.h"

namespace krot::internal {

// What the files of certificates, conflicts and baselines have in common.

using CertificateFileJson = nlohmann::ordered_json;

// The array of what `of` makes of each item.
template <typename Items, typename Of>
CertificateFileJson ListJson(const Items& items, const Of& of) {
  CertificateFileJson list = CertificateFileJson::array();
  for (const auto& item : items) list.push_back(of(item));
  return list;
}
inline CertificateFileJson VectorJson(const Eigen::Vector3d& x) {
  return {x[0], x[1], x[2]};
}

// A value of a parsed file, with its place there. Every error is a ModelError
// that names the file and the place.
class PlacedJson {
 public:
  using Json = CertificateFileJson;

  // The whole file. Keeps references.
  PlacedJson(const std::string& file_name, const Json& file)
      : file_name_(file_name), json_(file) {}

  const Json& json() const { return json_; }
  bool Has(const char* key) const { return json_.contains(key); }
  // The member of an object.
  PlacedJson operator[](const char* key) const;
  // The elements of an array.
  std::vector<PlacedJson> Elements() const;

  double Number() const;
  std::string String() const;
  Eigen::Vector2d Pair() const;
  Eigen::Vector3d Triple() const;
  Eigen::Quaterniond Quaternion() const;  // QW QX QY QZ
  template <typename Unsigned>
  Unsigned Integer() const {
    return static_cast<Unsigned>(
        IntegerUpTo(std::numeric_limits<Unsigned>::max()));
  }

  [[noreturn]] void Fail(const std::string& expected) const;

 private:
  PlacedJson(const std::string& file_name, const Json& json, std::string place)
      : file_name_(file_name), json_(json), place_(std::move(place)) {}

  uint64_t IntegerUpTo(uint64_t largest) const;
  template <int kCount>
  Eigen::Matrix<double, kCount, 1> Numbers(const char* expected) const;

  const std::string& file_name_;
  const Json& json_;
  const std::string place_;  // empty: the whole file
};

// Returns what `read` makes of the file.
template <typename Read>
auto ParseFile(const std::string& json, const std::string& file_name,
               const Read& read) {
  try {
    const CertificateFileJson file = CertificateFileJson::parse(json);
    return read(PlacedJson(file_name, file));
  } catch (const CertificateFileJson::exception& error) {
    throw ModelError(file_name + ": no JSON: " + error.what());
  }
}

// The member "version" of a file; fails unless it is in [first, last].
int ReadVersion(const PlacedJson& file, int first, int last);

// Whether the text is an object with this member.
bool HasMember(const std::string& json, const char* key);

CertificateFileJson NormJson(Norm norm);
Norm ReadNorm(const PlacedJson& json);

// The support of a certificate.
CertificateFileJson SupportJson(
    const std::vector<CertificateFile::SupportObservation>& observations);
// Reads its bounds and its support.
void ReadProof(const PlacedJson& json, DescribedProof* proof);

}  // namespace krot::internal
