#include "krot/model/positions_file.h"

#include <cmath>
#include <optional>
#include <string>
#include <string_view>

#include "krot/model/id_index.h"
#include "krot/model/image_names.h"
#include "krot/model/model_error.h"
#include "krot/model/text_reader.h"

namespace krot {
namespace {

using Eigen::Vector3d;

// Numbers of a line: a ball's, an ellipsoid's, and one's that is turned.
constexpr size_t kOfBall = 4;
constexpr size_t kOfAxes = 6;
constexpr size_t kOfTurnedAxes = 10;
constexpr char kExpectedNumber[] =
    "a finite number: X, Y, Z, RADIUS of a position";
// Of two semi-axes.
constexpr double kLargestRatio = 1e4;

double ParseFinite(std::string_view word, const TextReader& reader) {
  const auto value = TextReader::ParseNumber<double>(word);
  if (!value || !std::isfinite(*value)) {
    reader.Fail("\"" + std::string(word) + "\"", kExpectedNumber);
  }
  return *value;
}

// The last `count` words of the line, which the line then lacks.
std::vector<double> TakeLast(size_t count, TextReader* reader) {
  std::vector<double> numbers(count);
  for (size_t k = count; k-- > 0;) {
    numbers[k] = ParseFinite(reader->LastWord(kExpectedNumber), *reader);
  }
  return numbers;
}

// Whether the line is a name of the model and so many words.
bool HasNumbers(size_t count, const ImageNames& names, TextReader reader) {
  for (size_t k = 0; k < count; ++k) {
    if (reader.AtEnd()) return false;
    const auto value =
        TextReader::ParseNumber<double>(reader.LastWord(kExpectedNumber));
    if (!value) return false;
  }
  return names.Has(reader.Rest());
}

Ellipsoid RegionOf(const std::vector<double>& v, const TextReader& reader) {
  Ellipsoid region = Ball({v[0], v[1], v[2]}, v[3]);
  if (v.size() >= kOfAxes) region.semi_axes = {v[3], v[4], v[5]};
  if (v.size() == kOfTurnedAxes) {
    region.world_from_axes = {v[6], v[7], v[8], v[9]};
  }
  if (!(region.semi_axes.minCoeff() > 0)) {
    std::string found = "\"";
    AppendNumber(region.semi_axes.minCoeff(), &found);
    reader.Fail(found + "\"", "a radius above zero");
  }
  if (!IsFit(region)) {
    reader.Fail("semi-axes or a quaternion out of range",
                "axes of which none is 10,000 times another, and a quaternion "
                "that is not zero");
  }
  return region;
}

// Notes the line that names `index`; fails if another does already.
void NoteLine(int32_t index, const std::string& name, const TextReader& reader,
              std::vector<size_t>* line_of) {
  size_t& line = (*line_of)[index];
  if (line > 0) {
    reader.Fail(name + " again",
                "each once; line " + std::to_string(line) + " names it");
  }
  line = reader.line_number();
}

void RequireAny(const std::vector<KnownPosition>& positions,
                const FileBytes& file) {
  if (!positions.empty()) return;
  throw ModelError(file.path +
                   ": found no position, expected one on a line each");
}

}  // namespace

bool IsFit(const Ellipsoid& region) {
  const double norm = region.world_from_axes.norm();
  return region.centre.allFinite() && region.semi_axes.allFinite() &&
         region.semi_axes.minCoeff() > 0 &&
         region.semi_axes.maxCoeff() <=
             kLargestRatio * region.semi_axes.minCoeff() &&
         std::isfinite(norm) && norm > 0;
}

std::vector<KnownPosition> ReadPositions(const FileBytes& file,
                                         const Model& model) {
  const ImageNames names(model);
  std::vector<KnownPosition> positions;
  std::vector<size_t> line_of_image(model.images.size(), 0);
  TextReader reader(file);
  while (reader.NextRecord()) {
    size_t count = kOfBall;  // unless more of them leave a name
    for (const size_t more : {kOfAxes, kOfTurnedAxes}) {
      if (HasNumbers(more, names, reader)) count = more;
    }
    const std::vector<double> numbers = TakeLast(count, &reader);
    const std::string_view name = reader.Rest();
    if (name.empty()) {
      reader.Fail("no name", "an image's name in front of X Y Z RADIUS");
    }
    const int32_t image = names.Find(name, reader);
    NoteLine(image, "\"" + std::string(name) + "\"", reader, &line_of_image);
    positions.push_back(
        {KnownPosition::Of::kImage, image, RegionOf(numbers, reader)});
  }
  RequireAny(positions, file);
  return positions;
}

std::vector<KnownPosition> ReadPointPositions(const FileBytes& file,
                                              const Model& model) {
  const IdIndex<Point3DId> index(model.points3D);
  std::vector<KnownPosition> positions;
  std::vector<size_t> line_of_point(model.points3D.size(), 0);
  TextReader reader(file);
  while (reader.NextRecord()) {
    const auto id = reader.Number<Point3DId>("the id of a 3D point");
    const std::string name = "3D point " + std::to_string(id);
    const std::optional<int32_t> point = index.Find(id);
    if (!point) reader.Fail(name, "the id of a 3D point of the model");
    NoteLine(*point, name, reader, &line_of_point);
    std::vector<double> numbers;
    while (!reader.AtEnd()) {
      numbers.push_back(ParseFinite(reader.Word(kExpectedNumber), reader));
    }
    if (numbers.size() != kOfBall && numbers.size() != kOfAxes &&
        numbers.size() != kOfTurnedAxes) {
      reader.Fail(std::to_string(numbers.size()) + " numbers behind the id",
                  "X Y Z RADIUS, or X Y Z and three semi-axes, or these and QW "
                  "QX QY QZ");
    }
    positions.push_back(
        {KnownPosition::Of::kPoint3D, *point, RegionOf(numbers, reader)});
  }
  RequireAny(positions, file);
  return positions;
}

}  // namespace krot
