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

// "a.jpg to b.jpg", "3D point 12 to 3D point 7".
std::string NameOf(const Model& model, const KnownDistance& distance);

// Reads the distances that a text file lists (scale bars: docs/formats.md). A
// line holds two image names or ids of 3D points, and behind them METRES and
// TOLERANCE; `may_lack_metres` allows lines without these two, for distances
// that are to be measured. Names may contain blanks. A number is the id of a 3D
// point unless an image has it for a name. Lines that name something the model
// does not have are skipped, and `note` is told. Throws ModelError, with the
// line, for any other line, and if nothing in the file belongs to the model.
std::vector<KnownDistance> ReadDistances(const FileBytes& file,
                                         const Model& model,
                                         bool may_lack_metres,
                                         const FileNote& note = {});

// The same distances for another model, in which images are found by name and
// points by id; an index is -1 if the other model has none.
std::vector<KnownDistance> InOtherModel(std::vector<KnownDistance> distances,
                                        const Model& model, const Model& other);

// The length of each distance in the model, scene units; NaN if an end is
// missing or has no position.
std::vector<double> LengthsOf(const Model& model,
                              const std::vector<KnownDistance>& distances);

// The scale of a model that follows from known distances.
struct DistanceScale {
  // Metres per scene unit, and the interval that all agreeing distances allow.
  double scale = 0;
  double lowest = 0;
  double highest = 0;
  // For each distance, whether it agrees. False without a length or metres.
  std::vector<char> agrees;
  int64_t num_agreeing = 0;
  // Whether no other set of agreeing distances is as large.
  bool is_unique = true;
};

// Finds the scale that the most distances agree with. Each distance d with
// tolerance t allows the scales in [(d - t) / length, (d + t) / length]. The
// largest set of intervals that share a point is found exactly; within what
// they share, the scale minimises the sum of ((scale length - d) / t)^2. Among
// sets of equal size the one with the lowest sum counts. None if no distance
// has metres and a length above zero. O(square of the number of distances).
std::optional<DistanceScale> FindScale(
    const std::vector<double>& lengths,
    const std::vector<KnownDistance>& distances);

// Throws ModelError, which begins with `where`, unless the scale of `count`
// distances is unique.
void RequireOneScale(const std::string& where, size_t count,
                     const DistanceScale& scale);

// The known distances as one model has them.
struct MeasuredDistances {
  std::vector<double> lengths;  // scene units
  // None: no distance has both ends in the model.
  std::optional<DistanceScale> scale;
};

// Measures the distances and finds the scale by FindScale, or takes `scale` if
// it is given: then a distance agrees if it is within its tolerance.
MeasuredDistances MeasureDistances(const Model& model,
                                   const std::vector<KnownDistance>& distances,
                                   std::optional<double> scale = {});

// The same distances in one or several models.
struct DistanceReport {
  std::vector<std::string> names;
  std::vector<KnownDistance> distances;
  // Before and after, or the first and the second one.
  std::vector<MeasuredDistances> models;
  bool is_scale_taken = false;  // the written model was scaled to metres by it
};

}  // namespace krot::internal
