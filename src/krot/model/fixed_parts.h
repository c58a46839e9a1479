#pragma once

#include <vector>

#include "krot/model.h"
#include "krot/model/file_bytes.h"

namespace krot::internal {

// The frames of the images that a text file lists, by name or, where no image
// has such a name, by id; one per line, comments with #. An image may be listed
// twice; what the model does not have is skipped, and `note` told. Requires a
// valid model. Throws ModelError, with the line, for a name of two images and
// for an image without a pose to keep; and for a file that names nothing that
// the model has.
std::vector<char> FixedFrames(const FileBytes& file, const Model& model,
                              const FileNote& note = {});

// The 3D points of which a text file lists the ids, likewise.
std::vector<char> FixedPoints3D(const FileBytes& file, const Model& model,
                                const FileNote& note = {});

}  // namespace krot::internal
