#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "krot/model.h"
#include "krot/model/formats.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"

namespace krot::internal {

// Text files beside a model that list names or ids with numbers: positions,
// rotations, parts that must not move. docs/formats.md describes their lines.

// Reads the lines of such a list one after another. An image is given by its
// name, or by a path that ends with the name behind a slash or backslash: the
// longest such name counts. A 3D point is given by its id. All indices are
// those of Model::images or Model::points3D.
class ListReader {
 public:
  enum class Of {
    kImages,
    kImagesOrIds,  // or by its id, where no image has such a name
    kPoints3D,
    kPairs  // of images, or points, or one of each
  };

  // Keeps references to the file and the model.
  ListReader(const FileBytes& file, const Model& model, Of of);

  bool Next() { return reader_.NextRecord(); }

  // The image or point whose name is this whole line. If the model does not
  // have it, the line is counted as skipped, and none is returned.
  std::optional<int32_t> TakeName();

  struct Line {
    int32_t index;
    std::vector<double> numbers;  // finite
  };
  // Splits this line into a name and numbers. `counts` says, in descending
  // order, how many numbers are allowed; the largest count that leaves a name
  // of the model is taken. If there is no such name, the line is counted as
  // skipped, and none is returned; likewise none for a header, that is, if the
  // list's first line has no word that is a number. Fails, with what was
  // `expected`, for a wrong count of numbers, and for a name that another line
  // has, too.
  std::optional<Line> Take(const std::vector<size_t>& counts,
                           const std::string& expected);

  struct PairLine {
    std::array<KnownDistance::End, 2> ends;
    std::vector<double> numbers;  // finite
  };
  // Splits this line into two names and `count` numbers, or none if
  // `may_lack_numbers`. The names are those of images or, if no image has such
  // a name, ids of 3D points. Otherwise as Take.
  std::optional<PairLine> TakePair(size_t count, bool may_lack_numbers,
                                   const std::string& expected);

  // Throws ModelError if there was no line, or none whose name the model has;
  // tells `note` which lines were skipped.
  void Finish(const FileNote& note) const;

  const TextReader& reader() const { return reader_; }
  const std::string& header() const { return header_; }  // "" without one

 private:
  // Counts lines of one kind and keeps the first one.
  struct Tally {
    void Add(const std::string& line) {
      if (++count == 1) first = line;
    }
    int64_t count = 0;
    std::string first;
  };

  // The index of what has this name; none if the model does not have it. Fails
  // if several images have it.
  std::optional<int32_t> Find(std::string_view name) const;
  std::optional<int32_t> FindPoint(std::string_view name) const;
  std::optional<std::array<KnownDistance::End, 2>> FindPair(
      std::string_view names) const;
  Line TakeNumbers(std::string_view name, std::vector<double> numbers,
                   const std::string& expected);
  // Counts a path that is taken for an image's name.
  void NotePath(std::string_view name, int32_t index);
  // `image "a.jpg"`, `3D point 12`.
  std::string Described(std::string_view name) const;
  std::string NameOf(int32_t index) const;

  const FileBytes& file_;
  const Model& model_;
  const Of of_;
  TextReader reader_;
  std::unordered_map<std::string_view, int32_t> image_of_name_;
  IdIndex<ImageId> image_ids_;
  IdIndex<Point3DId> point_ids_;
  std::string header_;
  int64_t num_lines_ = 0;        // without the header
  std::vector<size_t> line_of_;  // of each index; 0: none so far
  Tally skipped_;
  Tally paths_;
};

}  // namespace krot::internal
