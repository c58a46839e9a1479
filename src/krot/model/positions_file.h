#pragma once

#include <optional>
#include <vector>

#include "krot/model.h"
#include "krot/model/file_bytes.h"

namespace krot::internal {

// Whether all is finite and the semi-axes are above zero and not too different
// for the digits of what is computed with them.
bool IsFit(const Ellipsoid& region);

struct PositionsOptions {
  // Of lines without one; > 0, scene units. None: such lines are refused.
  std::optional<double> radius;
  FileNote on_note = {};  // what was skipped
};

// The positions of images that a text file lists (GPS, surveys:
// docs/formats.md): a line holds an image's name, which may have blanks in it,
// X Y Z, and a RADIUS or three semi-axes, the latter along the model's axes or,
// with QW QX QY QZ, those that this turns into the model's. Images that the
// model does not have are skipped. Requires a valid model. Throws ModelError,
// with the line, for what is no such line and for a name that two images bear
// or that the file has twice; for a file that names no image of the model; and
// for latitudes and longitudes.
std::vector<KnownPosition> ReadPositions(const FileBytes& file,
                                         const Model& model,
                                         const PositionsOptions& options = {});

// The same of 3D points, by their ids.
std::vector<KnownPosition> ReadPointPositions(
    const FileBytes& file, const Model& model,
    const PositionsOptions& options = {});

}  // namespace krot::internal
