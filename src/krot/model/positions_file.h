#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/model/file_bytes.h"
#include "krot/model/model.h"

namespace krot {

// What is known of where an image was taken: its projection centre is no
// farther than `radius` from `xyz`, in the model's frame and unit.
struct KnownPosition {
  int32_t image = 0;  // index in Model::images
  Eigen::Vector3d xyz;
  double radius = 0;  // > 0
};

// The positions that a text file lists (GPS, surveys: docs/formats.md): a line
// holds an image's name, which may have blanks in it, and the last four of its
// words, X Y Z RADIUS. Requires a valid model. Throws ModelError, with the
// line, for what is no such line, for an image that the model does not have or
// has twice, or that the file names twice, and for a file without lines.
std::vector<KnownPosition> ReadPositions(const FileBytes& file,
                                         const Model& model);

}  // namespace krot
