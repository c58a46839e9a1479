#include "krot/convert/certificate_json.h"

#include <limits>
#include <utility>

#include "krot/context.h"

namespace krot::internal {
namespace {

using Json = CertificateFileJson;

Json TripleJson(const Eigen::Vector3d& x) { return {x[0], x[1], x[2]}; }

CertificateFile::SupportObservation ReadObservation(const JsonReader& reader,
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
  o.bearing = reader.Triple(member("bearing"), place + ".bearing");
  o.lambda = reader.Number(member("lambda"), place + ".lambda");
  o.y = reader.Pair(member("y"), place + ".y");
  return o;
}

}  // namespace

JsonReader::JsonReader(std::string file_name)
    : file_name_(std::move(file_name)) {}

void JsonReader::Fail(const std::string& place, const Json& found,
                      const std::string& expected) const {
  std::string text = found.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > 40) text = text.substr(0, 40) + "...";
  throw ModelError(file_name_ + ": " + place + " is " + text + ", expected " +
                   expected);
}

const Json& JsonReader::Member(const Json& object, const std::string& place,
                               const char* key) const {
  if (!object.is_object()) Fail(place, object, "an object");
  const auto found = object.find(key);
  if (found == object.end()) {
    throw ModelError(file_name_ + ": " + place + " has no \"" + key + "\"");
  }
  return *found;
}

double JsonReader::Number(const Json& value, const std::string& place) const {
  if (!value.is_number()) Fail(place, value, "a number");
  return value.get<double>();
}

uint64_t JsonReader::Id(const Json& value, const std::string& place,
                        uint64_t largest) const {
  if (!value.is_number_unsigned() || value.get<uint64_t>() > largest) {
    Fail(place, value, "an integer in [0, " + std::to_string(largest) + "]");
  }
  return value.get<uint64_t>();
}

std::string JsonReader::String(const Json& value,
                               const std::string& place) const {
  if (!value.is_string()) Fail(place, value, "a string");
  return value.get<std::string>();
}

const Json& JsonReader::Array(const Json& value,
                              const std::string& place) const {
  if (!value.is_array()) Fail(place, value, "an array");
  return value;
}

Eigen::Vector3d JsonReader::Triple(const Json& value,
                                   const std::string& place) const {
  if (!value.is_array() || value.size() != 3) {
    Fail(place, value, "an array of three numbers");
  }
  return {Number(value[0], place), Number(value[1], place),
          Number(value[2], place)};
}

Eigen::Quaterniond JsonReader::Quaternion(const Json& value,
                                          const std::string& place) const {
  if (!value.is_array() || value.size() != 4) {
    Fail(place, value, "an array of four numbers");
  }
  return {Number(value[0], place), Number(value[1], place),
          Number(value[2], place), Number(value[3], place)};
}

Eigen::Vector2d JsonReader::Pair(const Json& value,
                                 const std::string& place) const {
  if (!value.is_array() || value.size() != 2) {
    Fail(place, value, "an array of two numbers");
  }
  return {Number(value[0], place), Number(value[1], place)};
}

Norm JsonReader::ReadNorm(const Json& value) const {
  const std::string name = String(value, "norm");
  if (name == "1") return Norm::L1();
  if (name == "2") return Norm::L2();
  if (name == "inf") return Norm::LInf();
  Fail("norm", value, "\"1\", \"2\" or \"inf\"");
}

std::vector<CertificateFile::SupportObservation> JsonReader::ReadSupport(
    const Json& observations, const std::string& place) const {
  std::vector<CertificateFile::SupportObservation> support;
  Array(observations, place);
  for (size_t n = 0; n < observations.size(); ++n) {
    support.push_back(ReadObservation(*this, observations[n],
                                      place + "[" + std::to_string(n) + "]"));
  }
  return support;
}

void JsonReader::ReadFixed(const Json& fixed, CertificateFile* file) const {
  const Json& images = Array(Member(fixed, "fixed", "images"), "fixed.images");
  for (size_t n = 0; n < images.size(); ++n) {
    const std::string place = "fixed.images[" + std::to_string(n) + "]";
    file->fixed_images.push_back(
        {static_cast<ImageId>(Id(Member(images[n], place, "image_id"),
                                 place + ".image_id",
                                 std::numeric_limits<ImageId>::max())),
         Triple(Member(images[n], place, "translation"),
                place + ".translation")});
  }
  const Json& points =
      Array(Member(fixed, "fixed", "points3D"), "fixed.points3D");
  for (size_t n = 0; n < points.size(); ++n) {
    const std::string place = "fixed.points3D[" + std::to_string(n) + "]";
    file->fixed_points.push_back(
        {Id(Member(points[n], place, "point3D_id"), place + ".point3D_id",
            std::numeric_limits<Point3DId>::max()),
         Triple(Member(points[n], place, "xyz"), place + ".xyz")});
  }
}

void JsonReader::ReadPositions(const Json& positions,
                               CertificateFile* file) const {
  Array(positions, "positions");
  for (size_t n = 0; n < positions.size(); ++n) {
    const std::string place = "positions[" + std::to_string(n) + "]";
    const auto member = [&](const char* key) -> const Json& {
      return Member(positions[n], place, key);
    };
    CertificateFile::Position position;
    if (positions[n].contains("point3D_id")) {
      position.of = KnownPosition::Of::kPoint3D;
      position.id = Id(member("point3D_id"), place + ".point3D_id",
                       std::numeric_limits<Point3DId>::max());
    } else {
      position.id = Id(member("image_id"), place + ".image_id",
                       std::numeric_limits<ImageId>::max());
    }
    position.region.centre = Triple(member("xyz"), place + ".xyz");
    if (positions[n].contains("semi_axes")) {
      position.region.semi_axes =
          Triple(member("semi_axes"), place + ".semi_axes");
      position.region.world_from_axes =
          Quaternion(member("axes_qvec"), place + ".axes_qvec");
    } else {
      position.region.semi_axes.setConstant(
          Number(member("radius"), place + ".radius"));
    }
    const Json& rows = Array(member("rows"), place + ".rows");
    for (size_t k = 0; k < rows.size(); ++k) {
      const std::string row = place + ".rows[" + std::to_string(k) + "]";
      position.rows.push_back(
          {Triple(Member(rows[k], row, "apex"), row + ".apex"),
           Number(Member(rows[k], row, "lambda"), row + ".lambda"),
           Pair(Member(rows[k], row, "y"), row + ".y")});
    }
    file->positions.push_back(std::move(position));
  }
}

CertificateFileJson PositionsJson(const CertificateFile& file) {
  Json positions = Json::array();
  for (const CertificateFile::Position& position : file.positions) {
    Json rows = Json::array();
    for (const CertificateFile::Position::Row& row : position.rows) {
      rows.push_back({{"apex", TripleJson(row.apex)},
                      {"lambda", row.lambda},
                      {"y", {row.y[0], row.y[1]}}});
    }
    const Ellipsoid& region = position.region;
    const bool is_images = position.of == KnownPosition::Of::kImage;
    Json json = {{is_images ? "image_id" : "point3D_id", position.id},
                 {"xyz", TripleJson(region.centre)}};
    if (region.IsBall()) {
      json["radius"] = region.semi_axes[0];
    } else {
      const Eigen::Quaterniond& q = region.world_from_axes;
      json["semi_axes"] = TripleJson(region.semi_axes);
      json["axes_qvec"] = {q.w(), q.x(), q.y(), q.z()};
    }
    json["rows"] = rows;
    positions.push_back(std::move(json));
  }
  return positions;
}

CertificateFileJson FixedJson(const CertificateFile& file) {
  Json images = Json::array();
  for (const CertificateFile::FixedImage& image : file.fixed_images) {
    images.push_back({{"image_id", image.image_id},
                      {"translation", TripleJson(image.translation)}});
  }
  Json points = Json::array();
  for (const CertificateFile::FixedPoint& point : file.fixed_points) {
    points.push_back(
        {{"point3D_id", point.point3D_id}, {"xyz", TripleJson(point.xyz)}});
  }
  return {{"images", images}, {"points3D", points}};
}

CertificateFileJson NormJson(Norm norm) {
  if (norm.p == 1) return "1";
  return norm.p == 2 ? "2" : "inf";
}

CertificateFileJson SupportJson(
    const std::vector<CertificateFile::SupportObservation>& support) {
  Json observations = Json::array();
  for (const CertificateFile::SupportObservation& o : support) {
    Json json = {
        {"image_id", o.image_id},     {"point2D_idx", o.point2D_idx},
        {"point3D_id", o.point3D_id}, {"bearing", TripleJson(o.bearing)},
        {"lambda", o.lambda},         {"y", {o.y[0], o.y[1]}}};
    observations.push_back(std::move(json));
  }
  return observations;
}

}  // namespace krot::internal
