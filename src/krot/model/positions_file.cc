#include "krot/model/positions_file.h"

#include <array>
#include <cmath>
#include <string>
#include <string_view>

#include "krot/model/image_names.h"
#include "krot/model/model_error.h"
#include "krot/model/text_reader.h"

namespace krot {
namespace {

// Takes the last four words of the line.
KnownPosition ReadBall(TextReader* reader) {
  constexpr char kExpected[] = "a finite number: X, Y, Z, RADIUS of a position";
  std::array<double, 4> values;
  for (size_t k = values.size(); k-- > 0;) {
    const std::string_view word = reader->LastWord(kExpected);
    const auto value = TextReader::ParseNumber<double>(word);
    if (!value || !std::isfinite(*value)) {
      reader->Fail("\"" + std::string(word) + "\"", kExpected);
    }
    if (k == 3 && !(*value > 0)) {
      reader->Fail("\"" + std::string(word) + "\"", "a radius above zero");
    }
    values[k] = *value;
  }
  return {-1, {values[0], values[1], values[2]}, values[3]};
}

}  // namespace

std::vector<KnownPosition> ReadPositions(const FileBytes& file,
                                         const Model& model) {
  const ImageNames names(model);
  std::vector<KnownPosition> positions;
  std::vector<size_t> line_of_image(model.images.size(), 0);
  TextReader reader(file);
  while (reader.NextRecord()) {
    KnownPosition position = ReadBall(&reader);
    const std::string_view name = reader.Rest();
    if (name.empty()) {
      reader.Fail("no name", "an image's name in front of X Y Z RADIUS");
    }
    position.image = names.Find(name, reader);
    size_t& line = line_of_image[position.image];
    if (line > 0) {
      reader.Fail(
          "\"" + std::string(name) + "\" again",
          "each image once; line " + std::to_string(line) + " names it");
    }
    line = reader.line_number();
    positions.push_back(position);
  }
  if (positions.empty()) {
    throw ModelError(file.path +
                     ": found no position, expected one on a line each");
  }
  return positions;
}

}  // namespace krot
