#include "krot/bridge/certificate_file.h"

#include <fstream>
#include <set>
#include <sstream>
#include <utility>

#include "krot/bridge/certificate_json.h"
#include "krot/bridge/model_digest.h"
#include "krot/bridge/position_rows.h"
#include "krot/context.h"

namespace krot::internal {
namespace {

using Json = CertificateFileJson;

CertificateFile ReadCertificate(const JsonReader& reader, const Json& json) {
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
  file.norm = reader.ReadNorm(member("norm"));
  file.lower_bound = reader.Number(member("lower_bound"), "lower_bound");
  file.rows_bound = file.version == 1
                        ? file.lower_bound
                        : reader.Number(member("rows_bound"), "rows_bound");
  file.defect = reader.Number(member("defect"), "defect");
  file.model_sha256 = reader.String(member("model_sha256"), "model_sha256");
  file.observations =
      reader.ReadSupport(member("observations"), file.version, "observations");
  const auto fixed = json.find("fixed");
  if (fixed != json.end()) reader.ReadFixed(*fixed, &file);
  const auto positions = json.find("positions");
  if (positions != json.end()) reader.ReadPositions(*positions, &file);
  return file;
}

}  // namespace

std::vector<CertificateFile::SupportObservation> DescribeSupport(
    const Model& model, const BuiltProblem& built,
    const PixelCertificate& certificate) {
  std::vector<CertificateFile::SupportObservation> support;
  for (size_t n = 0; n < certificate.bearings.size(); ++n) {
    const CertifiedObservation& certified = certificate.rows.observations[n];
    if (!built.HasPixel(certified.observation)) continue;
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
    support.push_back(o);
  }
  return support;
}

namespace {

// What of the support does not move.
void DescribeFixed(const Model& model, const BuiltProblem& built,
                   const PixelCertificate& certificate, CertificateFile* file) {
  const KnownRotationProblem& problem = built.problem;
  std::set<int32_t> frames;
  std::set<int32_t> points;
  for (const CertifiedObservation& certified : certificate.rows.observations) {
    if (!built.HasPixel(certified.observation)) continue;
    const Observation& observation =
        problem.observations[certified.observation];
    const int32_t frame = problem.views[observation.view].frame;
    if (problem.IsFixedFrame(frame) && frames.insert(frame).second) {
      file->fixed_images.push_back(
          {model.images[built.image_of[observation.view]].id,
           *problem.fixed_translations[frame]});
    }
    if (problem.IsFixedPoint(observation.point) &&
        points.insert(observation.point).second) {
      file->fixed_points.push_back(
          {model.points3D[built.point_of[observation.point]].id,
           *problem.fixed_points[observation.point]});
    }
  }
}

// The positions in the support; rows ascend, so that a position's stand
// together.
void DescribePositions(const Model& model, const BuiltProblem& built,
                       const PixelCertificate& certificate,
                       CertificateFile* file) {
  int64_t last = -1;
  for (size_t n = 0; n < certificate.bearings.size(); ++n) {
    const CertifiedObservation& certified = certificate.rows.observations[n];
    if (built.HasPixel(certified.observation)) continue;
    const int64_t index = PositionOf(built, certified.observation);
    if (index != std::exchange(last, index)) {
      const BuiltPosition& position = built.positions[index];
      file->positions.push_back(
          {position.of, IdOf(model, built, position), position.region, {}});
    }
    file->positions.back().rows.push_back(
        {certificate.bearings[n], certified.lambda, certified.y});
  }
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
  file.observations = DescribeSupport(model, built, certificate);
  DescribeFixed(model, built, certificate, &file);
  DescribePositions(model, built, certificate, &file);
  return file;
}

std::string CertificateJson(const CertificateFile& file) {
  Json json = {{"version", file.version},
               {"norm", NormJson(file.norm)},
               {"lower_bound", file.lower_bound}};
  if (file.version != 1) json["rows_bound"] = file.rows_bound;
  json["defect"] = file.defect;
  json["model_sha256"] = file.model_sha256;
  if (!file.fixed_images.empty() || !file.fixed_points.empty()) {
    json["fixed"] = FixedJson(file);
  }
  if (!file.positions.empty()) json["positions"] = PositionsJson(file);
  json["observations"] = SupportJson(file.observations, file.version);
  return json.dump(1) + "\n";
}

CertificateFile ParseCertificate(const std::string& json,
                                 const std::string& file_name) {
  try {
    return ReadCertificate(JsonReader(file_name), Json::parse(json));
  } catch (const Json::exception& error) {
    throw ModelError(file_name + ": no JSON: " + error.what());
  }
}

std::string ReadCertificateText(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  // Fails on an empty file, too, and on a folder.
  if (!stream.is_open() || !(text << stream.rdbuf())) {
    throw ModelError(path.string() + ": cannot be read, or is empty");
  }
  return text.str();
}

CertificateFile ReadCertificateFile(const std::filesystem::path& path) {
  return ParseCertificate(ReadCertificateText(path), path.string());
}

}  // namespace krot::internal
