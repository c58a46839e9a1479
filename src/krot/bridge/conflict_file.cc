#include "krot/bridge/conflict_file.h"

#include <utility>

#include "krot/bridge/certificate_json.h"
#include "krot/bridge/model_digest.h"
#include "krot/model/model_error.h"

namespace krot {
namespace {

using Json = CertificateFileJson;

ConflictFile ReadConflicts(const JsonReader& reader, const Json& json) {
  const auto member = [&](const char* key) -> const Json& {
    return reader.Member(json, "the file", key);
  };
  const Json& version = member("version");
  if (version != kConflictFileVersion) {
    reader.Fail("version", version, std::to_string(kConflictFileVersion));
  }
  ConflictFile file;
  file.norm = reader.ReadNorm(member("norm"));
  file.max_error = reader.Number(member("max_error"), "max_error");
  file.model_sha256 = reader.String(member("model_sha256"), "model_sha256");
  const Json& conflicts = reader.Array(member("conflicts"), "conflicts");
  for (size_t n = 0; n < conflicts.size(); ++n) {
    const std::string place = "conflicts[" + std::to_string(n) + "]";
    const auto number = [&](const char* key) {
      return reader.Number(reader.Member(conflicts[n], place, key),
                           place + "." + key);
    };
    ConflictFile::Conflict conflict;
    conflict.lower_bound = number("lower_bound");
    conflict.rows_bound = number("rows_bound");
    conflict.defect = number("defect");
    conflict.observations =
        reader.ReadSupport(reader.Member(conflicts[n], place, "observations"),
                           kCertificateVersion, place + ".observations");
    file.conflicts.push_back(std::move(conflict));
  }
  return file;
}

}  // namespace

ConflictFile DescribeConflicts(
    const Model& model, const BuiltProblem& built, Norm norm, double max_error,
    const std::vector<PixelCertificate>& certificates) {
  ConflictFile file;
  file.norm = norm;
  file.max_error = max_error;
  file.model_sha256 = ModelSha256(model);
  for (const PixelCertificate& certificate : certificates) {
    file.conflicts.push_back(
        {certificate.lower_bound, certificate.rows.lower_bound,
         certificate.rows.defect, DescribeSupport(model, built, certificate)});
  }
  return file;
}

std::string ConflictJson(const ConflictFile& file) {
  Json conflicts = Json::array();
  for (const ConflictFile::Conflict& conflict : file.conflicts) {
    conflicts.push_back({{"lower_bound", conflict.lower_bound},
                         {"rows_bound", conflict.rows_bound},
                         {"defect", conflict.defect},
                         {"observations", SupportJson(conflict.observations,
                                                      kCertificateVersion)}});
  }
  Json json = {{"version", file.version},
               {"norm", NormJson(file.norm)},
               {"max_error", file.max_error},
               {"model_sha256", file.model_sha256}};
  json["conflicts"] = std::move(conflicts);
  return json.dump(1) + "\n";
}

bool HoldsConflicts(const std::string& json) {
  const Json parsed = Json::parse(json, nullptr, /*allow_exceptions=*/false);
  return parsed.is_object() && parsed.contains("conflicts");
}

ConflictFile ParseConflicts(const std::string& json,
                            const std::string& file_name) {
  try {
    return ReadConflicts(JsonReader(file_name), Json::parse(json));
  } catch (const Json::exception& error) {
    throw ModelError(file_name + ": no JSON: " + error.what());
  }
}

}  // namespace krot
