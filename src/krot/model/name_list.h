#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "krot/model.h"
#include "krot/model/known_distances.h"
#include "krot/model/text_io.h"
#include "krot/model/validate.h"

namespace krot::internal {

// Text files beside a model that list names, or ids, and numbers: positions,
// rotations, what must not move. docs/formats.md says what a line may look
// like.

// Walks over the lines of a list. An image goes by its name, or by a path that
// ends with it behind a slash or backslash: the longest such name counts. A 3D
// point goes by its id. Whatever is indexed here is so as in Model::images or
// Model::points3D.
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

  // What this line, all of it a name, stands for; none, and counted, if the
  // model does not have it.
  std::optional<int32_t> TakeName();

  struct Line {
    int32_t index;
    std::vector<double> numbers;  // finite
  };
  // This line, a name and as many numbers as one of `counts` says, which
  // descend: the most that leave a name of the model. None, and counted, if
  // there is no such name; none, too, if it is the list's first line and a
  // header: no word of it is a number. Fails for a line with other numbers,
  // which are not what was `expected`, and for a name that another line has.
  std::optional<Line> Take(const std::vector<size_t>& counts,
                           const std::string& expected);

  struct PairLine {
    std::array<KnownDistance::End, 2> ends;
    std::vector<double> numbers;  // finite
  };
  // This line, two names, of images or, where no image has such a name, of 3D
  // points, and `count` numbers, or maybe none. Otherwise as Take.
  std::optional<PairLine> TakePair(size_t count, bool may_lack_numbers,
                                   const std::string& expected);

  // Throws ModelError if there was no line, or none whose name the model has;
  // tells `note` of those that were skipped.
  void Finish(const FileNote& note) const;

  const TextReader& reader() const { return reader_; }
  const std::string& header() const { return header_; }  // "" without one

 private:
  // Counts a line, with the first of its kind.
  struct Tally {
    void Add(const std::string& line) {
      if (++count == 1) first = line;
    }
    int64_t count = 0;
    std::string first;
  };

  // Of what bears the name; none if the model does not have it. Fails if
  // several images bear it.
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
  std::vector<size_t> line_of_;  // by index; 0: none so far
  Tally skipped_;
  Tally paths_;
};

}  // namespace krot::internal
