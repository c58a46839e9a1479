#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/model.h"
#include "krot/model/model_io.h"

namespace krot::internal {

// A distance between two cameras, or two points, or one of each, and what is
// known of it.
struct KnownDistance {
  struct End {
    bool is_image = false;
    int32_t index = 0;  // in Model::images or Model::points3D
  };
  std::array<End, 2> ends;
  std::optional<double> metres;  // > 0
  double tolerance = 0;          // metres; > 0 where these are known

  // "a.jpg to b.jpg", "3D point 12 to 3D point 7".
  std::string Name(const Model& model) const;
};

// The distances that a text file lists (scale bars: docs/formats.md). A line
// holds two images' names, or two ids of 3D points, and METRES and TOLERANCE
// behind them; `may_lack_metres` allows lines without these, for distances that
// are asked for. Names may have blanks in them; a number is a 3D point's id
// where no image has it for a name. Lines with what the model does not have are
// skipped, and `note` told. Throws ModelError, with the line, for what is no
// such line, and for a file that holds nothing of the model.
std::vector<KnownDistance> ReadDistances(const FileBytes& file,
                                         const Model& model,
                                         bool may_lack_metres,
                                         const FileNote& note = {});

// The same distances in another model, by images' names and points' ids; an
// index is -1 where it has none.
std::vector<KnownDistance> InOtherModel(std::vector<KnownDistance> distances,
                                        const Model& model, const Model& other);

// The length of each in the model, scene units; NaN where an end is not there,
// or stands nowhere.
std::vector<double> LengthsOf(const Model& model,
                              const std::vector<KnownDistance>& distances);

// What known distances say of a model's scale.
struct DistanceScale {
  // Metres for a scene unit; in the interval that all agreeing ones allow.
  double scale = 0;
  double lowest = 0;
  double highest = 0;
  // By distance: whether it agrees. Not so without a length or metres.
  std::vector<char> agrees;
  int64_t num_agreeing = 0;
  // Whether no other set of as many agrees with itself.
  bool is_unique = true;
};

// The scale that the most distances agree with. Each allows the scales in
// [(d - t) / length, (d + t) / length]; the largest number of these intervals
// that share a point is found exactly, and within what they share the least sum
// of squares of (scale length - d) / t. Among sets of as many the one with the
// lowest sum. None if no distance has metres and a length above zero.
// O(square of the number of distances).
std::optional<DistanceScale> FindScale(
    const std::vector<double>& lengths,
    const std::vector<KnownDistance>& distances);

// Known distances in one model.
struct MeasuredDistances {
  std::vector<double> lengths;         // scene units
  std::optional<DistanceScale> scale;  // none: no distance has both ends there
};

// By FindScale or, where the scale is known, by that: then what agrees is what
// has it in its interval.
MeasuredDistances MeasureDistances(const Model& model,
                                   const std::vector<KnownDistance>& distances,
                                   std::optional<double> scale = {});

// The same distances in one or several models.
struct DistanceReport {
  std::vector<std::string> names;
  std::vector<KnownDistance> distances;
  std::vector<MeasuredDistances> models;  // before and after, or the first's
                                          // and the second's
  bool is_scale_taken = false;  // the written model is in metres by it
};

}  // namespace krot::internal
