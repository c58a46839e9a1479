#pragma once

#include <cstdint>
#include <vector>

#include "krot/geometry/ellipsoid.h"
#include "krot/model/file_bytes.h"
#include "krot/model/model.h"

namespace krot {

// What is known of where an image was taken, or of where a 3D point is: the
// projection centre, or the point, is in `region`, in the model's frame and
// unit.
struct KnownPosition {
  enum class Of { kImage, kPoint3D };
  Of of = Of::kImage;
  int32_t index = 0;  // in Model::images or Model::points3D
  Ellipsoid region;
};

// Whether all is finite and the semi-axes are above zero and not too different
// for the digits of what is computed with them.
bool IsFit(const Ellipsoid& region);

// The positions of images that a text file lists (GPS, surveys:
// docs/formats.md): a line holds an image's name, which may have blanks in it,
// X Y Z, and a RADIUS or three semi-axes, the latter along the model's axes or,
// with QW QX QY QZ, those that this turns into the model's. Requires a valid
// model. Throws ModelError, with the line, for what is no such line, for an
// image that the model does not have or has twice, or that the file names
// twice, and for a file without lines.
std::vector<KnownPosition> ReadPositions(const FileBytes& file,
                                         const Model& model);

// The same of 3D points, by their ids.
std::vector<KnownPosition> ReadPointPositions(const FileBytes& file,
                                              const Model& model);

}  // namespace krot
