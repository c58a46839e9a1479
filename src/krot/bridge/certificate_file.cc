#include "krot/bridge/certificate_file.h"

#include <fstream>
#include <limits>
#include <sstream>

#include <nlohmann/json.hpp>

#include "krot/bridge/model_digest.h"
#include "krot/model/model_error.h"

namespace krot {
namespace {

using Json = nlohmann::ordered_json;

Json NormJson(Norm norm) {
  if (norm.p == 1) return "1";
  return norm.p == 2 ? "2" : "inf";
}

// Reads values out of a parsed file; every error names the file and the place.
class Reader {
 public:
  explicit Reader(const std::string& file_name) : file_name_(file_name) {}

  [[noreturn]] void Fail(const std::string& place, const Json& found,
                         const std::string& expected) const {
    std::string text =
        found.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (text.size() > 40) text = text.substr(0, 40) + "...";
    throw ModelError(file_name_ + ": " + place + " is " + text + ", expected " +
                     expected);
  }

  const Json& Member(const Json& object, const std::string& place,
                     const char* key) const {
    if (!object.is_object()) Fail(place, object, "an object");
    const auto found = object.find(key);
    if (found == object.end()) {
      throw ModelError(file_name_ + ": " + place + " has no \"" + key + "\"");
    }
    return *found;
  }

  double Number(const Json& value, const std::string& place) const {
    if (!value.is_number()) Fail(place, value, "a number");
    return value.get<double>();
  }

  uint64_t Id(const Json& value, const std::string& place,
              uint64_t largest) const {
    if (!value.is_number_unsigned() || value.get<uint64_t>() > largest) {
      Fail(place, value, "an integer in [0, " + std::to_string(largest) + "]");
    }
    return value.get<uint64_t>();
  }

  std::string String(const Json& value, const std::string& place) const {
    if (!value.is_string()) Fail(place, value, "a string");
    return value.get<std::string>();
  }

  const Json& Array(const Json& value, const std::string& place) const {
    if (!value.is_array()) Fail(place, value, "an array");
    return value;
  }

  Eigen::Vector2d Pair(const Json& value, const std::string& place) const {
    if (!value.is_array() || value.size() != 2) {
      Fail(place, value, "an array of two numbers");
    }
    return {Number(value[0], place), Number(value[1], place)};
  }

 private:
  const std::string& file_name_;
};

Norm ReadNorm(const Reader& reader, const Json& value) {
  const std::string name = reader.String(value, "norm");
  if (name == "1") return Norm::L1();
  if (name == "2") return Norm::L2();
  if (name == "inf") return Norm::LInf();
  reader.Fail("norm", value, "\"1\", \"2\" or \"inf\"");
}

// Version 1: u and J.
void ReadRow(const Reader& reader, const Json& u, const Json& J,
             const std::string& place,
             CertificateFile::SupportObservation* observation) {
  observation->u = reader.Pair(u, place + ".u");
  if (!J.is_array() || J.size() != 2) {
    reader.Fail(place + ".J", J, "two rows of two numbers");
  }
  observation->J.row(0) = reader.Pair(J[0], place + ".J[0]").transpose();
  observation->J.row(1) = reader.Pair(J[1], place + ".J[1]").transpose();
}

CertificateFile::SupportObservation ReadObservation(const Reader& reader,
                                                    int version,
                                                    const Json& json,
                                                    const std::string& place) {
  const auto member = [&](const char* key) -> const Json& {
    return reader.Member(json, place, key);
  };
  constexpr uint64_t kLargest32 = std::numeric_limits<uint32_t>::max();
  CertificateFile::SupportObservation o;
  o.image_id = static_cast<ImageId>(
      reader.Id(member("image_id"), place + ".image_id", kLargest32));
  o.point2D_idx = static_cast<uint32_t>(
      reader.Id(member("point2D_idx"), place + ".point2D_idx", kLargest32));
  o.point3D_id = reader.Id(member("point3D_id"), place + ".point3D_id",
                           std::numeric_limits<uint64_t>::max());
  if (version == 1) {
    ReadRow(reader, member("u"), member("J"), place, &o);
  } else {
    const Json& bearing = member("bearing");
    if (!bearing.is_array() || bearing.size() != 3) {
      reader.Fail(place + ".bearing", bearing, "an array of three numbers");
    }
    for (int k = 0; k < 3; ++k) {
      o.bearing[k] = reader.Number(bearing[k], place + ".bearing");
    }
  }
  o.lambda = reader.Number(member("lambda"), place + ".lambda");
  o.y = reader.Pair(member("y"), place + ".y");
  return o;
}

CertificateFile ReadCertificate(const Reader& reader, const Json& json) {
  const auto member = [&](const char* key) -> const Json& {
    return reader.Member(json, "the file", key);
  };
  const Json& version = member("version");
  if (version != 1 && version != kCertificateVersion) {
    reader.Fail("version", version,
                "1 or " + std::to_string(kCertificateVersion));
  }
  CertificateFile file;
  file.version = version.get<int>();
  file.norm = ReadNorm(reader, member("norm"));
  file.lower_bound = reader.Number(member("lower_bound"), "lower_bound");
  file.rows_bound = file.version == 1
                        ? file.lower_bound
                        : reader.Number(member("rows_bound"), "rows_bound");
  file.defect = reader.Number(member("defect"), "defect");
  file.model_sha256 = reader.String(member("model_sha256"), "model_sha256");
  const Json& observations =
      reader.Array(member("observations"), "observations");
  for (size_t n = 0; n < observations.size(); ++n) {
    file.observations.push_back(
        ReadObservation(reader, file.version, observations[n],
                        "observations[" + std::to_string(n) + "]"));
  }
  return file;
}

}  // namespace

CertificateFile DescribeCertificate(const Model& model,
                                    const BuiltProblem& built, Norm norm,
                                    const PixelCertificate& certificate) {
  CertificateFile file;
  file.norm = norm;
  file.lower_bound = certificate.lower_bound;
  file.rows_bound = certificate.rows.lower_bound;
  file.defect = certificate.rows.defect;
  file.model_sha256 = ModelSha256(model);
  for (size_t n = 0; n < certificate.bearings.size(); ++n) {
    const CertifiedObservation& certified = certificate.rows.observations[n];
    const Observation& observation =
        built.problem.observations[certified.observation];
    CertificateFile::SupportObservation o;
    o.image_id = model.images[built.image_of[observation.view]].id;
    o.point2D_idx =
        static_cast<uint32_t>(built.point2D_of[certified.observation]);
    o.point3D_id = model.points3D[built.point_of[observation.point]].id;
    o.bearing = certificate.bearings[n];
    o.lambda = certified.lambda;
    o.y = certified.y;
    file.observations.push_back(o);
  }
  return file;
}

std::string CertificateJson(const CertificateFile& file) {
  Json observations = Json::array();
  for (const CertificateFile::SupportObservation& o : file.observations) {
    Json json = {{"image_id", o.image_id},
                 {"point2D_idx", o.point2D_idx},
                 {"point3D_id", o.point3D_id}};
    if (file.version == 1) {
      json["u"] = {o.u[0], o.u[1]};
      json["J"] = {{o.J(0, 0), o.J(0, 1)}, {o.J(1, 0), o.J(1, 1)}};
    } else {
      json["bearing"] = {o.bearing[0], o.bearing[1], o.bearing[2]};
    }
    json["lambda"] = o.lambda;
    json["y"] = {o.y[0], o.y[1]};
    observations.push_back(std::move(json));
  }
  Json json = {{"version", file.version},
               {"norm", NormJson(file.norm)},
               {"lower_bound", file.lower_bound}};
  if (file.version != 1) json["rows_bound"] = file.rows_bound;
  json["defect"] = file.defect;
  json["model_sha256"] = file.model_sha256;
  json["observations"] = std::move(observations);
  return json.dump(1) + "\n";
}

CertificateFile ParseCertificate(const std::string& json,
                                 const std::string& file_name) {
  try {
    return ReadCertificate(Reader(file_name), Json::parse(json));
  } catch (const Json::exception& error) {
    throw ModelError(file_name + ": no JSON: " + error.what());
  }
}

CertificateFile ReadCertificateFile(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream json;
  // Fails on an empty file, too, and on a folder.
  if (!stream.is_open() || !(json << stream.rdbuf())) {
    throw ModelError(path.string() + ": cannot be read, or is empty");
  }
  return ParseCertificate(json.str(), path.string());
}

}  // namespace krot
