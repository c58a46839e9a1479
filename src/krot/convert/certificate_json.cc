#include "krot/convert/certificate_json.h"

namespace krot::internal {

using Json = CertificateFileJson;

void PlacedJson::Fail(const std::string& expected) const {
  std::string text = json_.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > 40) text = text.substr(0, 40) + "...";
  throw ModelError(file_name_ + ": " + (place_.empty() ? "the file" : place_) +
                   " is " + text + ", expected " + expected);
}

PlacedJson PlacedJson::operator[](const char* key) const {
  if (!json_.is_object()) Fail("an object");
  const auto found = json_.find(key);
  if (found == json_.end()) {
    throw ModelError(file_name_ + ": " +
                     (place_.empty() ? "the file" : place_) + " has no \"" +
                     key + "\"");
  }
  return {file_name_, *found, place_.empty() ? key : place_ + "." + key};
}

std::vector<PlacedJson> PlacedJson::Elements() const {
  if (!json_.is_array()) Fail("an array");
  std::vector<PlacedJson> elements;
  for (size_t n = 0; n < json_.size(); ++n) {
    elements.push_back(
        {file_name_, json_[n], place_ + "[" + std::to_string(n) + "]"});
  }
  return elements;
}

double PlacedJson::Number() const {
  if (!json_.is_number()) Fail("a number");
  return json_.get<double>();
}

uint64_t PlacedJson::IntegerUpTo(uint64_t largest) const {
  if (!json_.is_number_unsigned() || json_.get<uint64_t>() > largest) {
    Fail("an integer in [0, " + std::to_string(largest) + "]");
  }
  return json_.get<uint64_t>();
}

std::string PlacedJson::String() const {
  if (!json_.is_string()) Fail("a string");
  return json_.get<std::string>();
}

template <int kCount>
Eigen::Matrix<double, kCount, 1> PlacedJson::Numbers(
    const char* expected) const {
  if (!json_.is_array() || json_.size() != kCount) Fail(expected);
  Eigen::Matrix<double, kCount, 1> numbers;
  for (int n = 0; n < kCount; ++n) {
    numbers[n] = PlacedJson(file_name_, json_[n], place_).Number();
  }
  return numbers;
}

Eigen::Vector2d PlacedJson::Pair() const {
  return Numbers<2>("an array of two numbers");
}

Eigen::Vector3d PlacedJson::Triple() const {
  return Numbers<3>("an array of three numbers");
}

Eigen::Quaterniond PlacedJson::Quaternion() const {
  const Eigen::Vector4d q = Numbers<4>("an array of four numbers");
  return {q[0], q[1], q[2], q[3]};
}

int ReadVersion(const PlacedJson& file, int first, int last) {
  const PlacedJson version = file["version"];
  for (int known = first; known <= last; ++known) {
    if (version.json() == known) return known;
  }
  version.Fail((first < last ? std::to_string(first) + " or " : "") +
               std::to_string(last));
}

Json NormJson(Norm norm) {
  if (norm.p == 1) return "1";
  return norm.p == 2 ? "2" : "inf";
}

Norm ReadNorm(const PlacedJson& json) {
  const std::string name = json.String();
  if (name == "1") return Norm::L1();
  if (name == "2") return Norm::L2();
  if (name == "inf") return Norm::LInf();
  json.Fail("\"1\", \"2\" or \"inf\"");
}

Json SupportJson(
    const std::vector<CertificateFile::SupportObservation>& support) {
  return ListJson(support, [&](const auto& o) -> Json {
    return {{"image_id", o.image_id},     {"point2D_idx", o.point2D_idx},
            {"point3D_id", o.point3D_id}, {"bearing", VectorJson(o.bearing)},
            {"lambda", o.lambda},         {"y", {o.y[0], o.y[1]}}};
  });
}

void ReadProof(const PlacedJson& json, DescribedProof* proof) {
  proof->lower_bound = json["lower_bound"].Number();
  proof->rows_bound = json["rows_bound"].Number();
  proof->defect = json["defect"].Number();
  for (const PlacedJson& o : json["observations"].Elements()) {
    proof->observations.push_back(
        {o["image_id"].Integer<ImageId>(), o["point2D_idx"].Integer<uint32_t>(),
         o["point3D_id"].Integer<Point3DId>(), o["bearing"].Triple(),
         o["lambda"].Number(), o["y"].Pair()});
  }
}

namespace {

Json FixedJson(const CertificateFile& file) {
  Json images = ListJson(file.fixed_images, [&](const auto& image) -> Json {
    return {{"image_id", image.image_id},
            {"translation", VectorJson(image.translation)}};
  });
  Json points = ListJson(file.fixed_points, [&](const auto& point) -> Json {
    return {{"point3D_id", point.point3D_id}, {"xyz", VectorJson(point.xyz)}};
  });
  return {{"images", images}, {"points3D", points}};
}

void ReadFixed(const PlacedJson& fixed, CertificateFile* file) {
  for (const PlacedJson& image : fixed["images"].Elements()) {
    file->fixed_images.push_back(
        {image["image_id"].Integer<ImageId>(), image["translation"].Triple()});
  }
  for (const PlacedJson& point : fixed["points3D"].Elements()) {
    file->fixed_points.push_back(
        {point["point3D_id"].Integer<Point3DId>(), point["xyz"].Triple()});
  }
}

Json PositionsJson(const CertificateFile& file) {
  return ListJson(file.positions, [&](const auto& position) -> Json {
    const Ellipsoid& region = position.region;
    const bool is_images = position.of == KnownPosition::Of::kImage;
    Json json = {{is_images ? "image_id" : "point3D_id", position.id},
                 {"xyz", VectorJson(region.centre)}};
    if (region.IsBall()) {
      json["radius"] = region.semi_axes[0];
    } else {
      const Eigen::Quaterniond& q = region.world_from_axes;
      json["semi_axes"] = VectorJson(region.semi_axes);
      json["axes_qvec"] = {q.w(), q.x(), q.y(), q.z()};
    }
    json["rows"] = ListJson(position.rows, [](const auto& row) -> Json {
      return {{"apex", VectorJson(row.apex)},
              {"lambda", row.lambda},
              {"y", {row.y[0], row.y[1]}}};
    });
    return json;
  });
}

void ReadPositions(const PlacedJson& positions, CertificateFile* file) {
  for (const PlacedJson& json : positions.Elements()) {
    CertificateFile::Position& position = file->positions.emplace_back();
    if (json.Has("point3D_id")) {
      position.of = KnownPosition::Of::kPoint3D;
      position.id = json["point3D_id"].Integer<Point3DId>();
    } else {
      position.id = json["image_id"].Integer<ImageId>();
    }
    position.region.centre = json["xyz"].Triple();
    if (json.Has("semi_axes")) {
      position.region.semi_axes = json["semi_axes"].Triple();
      position.region.world_from_axes = json["axes_qvec"].Quaternion();
    } else {
      position.region.semi_axes.setConstant(json["radius"].Number());
    }
    for (const PlacedJson& row : json["rows"].Elements()) {
      position.rows.push_back(
          {row["apex"].Triple(), row["lambda"].Number(), row["y"].Pair()});
    }
  }
}

constexpr int kCertificateVersion = 2;

}  // namespace

std::string CertificateJson(const CertificateFile& file) {
  Json json = {
      {"version", kCertificateVersion},  {"norm", NormJson(file.norm)},
      {"lower_bound", file.lower_bound}, {"rows_bound", file.rows_bound},
      {"defect", file.defect},           {"model_sha256", file.model_sha256}};
  if (!file.fixed_images.empty() || !file.fixed_points.empty()) {
    json["fixed"] = FixedJson(file);
  }
  if (!file.positions.empty()) json["positions"] = PositionsJson(file);
  json["observations"] = SupportJson(file.observations);
  return json.dump(1) + "\n";
}

CertificateFile ParseCertificate(const std::string& text,
                                 const std::string& file_name) {
  return ParseFile(text, file_name, [](const PlacedJson& json) {
    ReadVersion(json, kCertificateVersion, kCertificateVersion);
    CertificateFile file;
    file.norm = ReadNorm(json["norm"]);
    file.model_sha256 = json["model_sha256"].String();
    ReadProof(json, &file);
    if (json.Has("fixed")) ReadFixed(json["fixed"], &file);
    if (json.Has("positions")) ReadPositions(json["positions"], &file);
    return file;
  });
}

bool HasMember(const std::string& json, const char* key) {
  const Json parsed = Json::parse(json, nullptr, /*allow_exceptions=*/false);
  return parsed.is_object() && parsed.contains(key);
}

std::string ConflictJson(const ConflictFile& file) {
  Json json = {{"version", file.version},
               {"norm", NormJson(file.norm)},
               {"max_error", file.max_error},
               {"model_sha256", file.model_sha256}};
  json["conflicts"] = ListJson(file.conflicts, [&](const auto& conflict) {
    Json one = {{"lower_bound", conflict.lower_bound},
                {"rows_bound", conflict.rows_bound},
                {"defect", conflict.defect},
                {"observations", SupportJson(conflict.observations)}};
    if (file.version == kConflictFileVersion) {
      one["max_errors"] = conflict.max_errors;
    }
    return one;
  });
  return json.dump(1) + "\n";
}

bool HoldsConflicts(const std::string& json) {
  return HasMember(json, "conflicts");
}

ConflictFile ParseConflicts(const std::string& text,
                            const std::string& file_name) {
  return ParseFile(text, file_name, [](const PlacedJson& json) {
    ConflictFile file;
    file.version = ReadVersion(json, 1, kConflictFileVersion);
    file.norm = ReadNorm(json["norm"]);
    file.max_error = json["max_error"].Number();
    file.model_sha256 = json["model_sha256"].String();
    for (const PlacedJson& one : json["conflicts"].Elements()) {
      ConflictFile::Conflict& conflict = file.conflicts.emplace_back();
      ReadProof(one, &conflict);
      if (file.version != kConflictFileVersion) continue;
      for (const PlacedJson& bound : one["max_errors"].Elements()) {
        conflict.max_errors.push_back(bound.Number());
      }
    }
    return file;
  });
}

}  // namespace krot::internal
