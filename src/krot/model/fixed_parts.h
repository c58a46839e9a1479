#pragma once

#include <cstdint>
#include <vector>

#include "krot/model/file_bytes.h"
#include "krot/model/model.h"

namespace krot {

// What of a model must not move, one mark per frame and per 3D point in the
// order of its records; empty: nothing of the kind.
struct FixedParts {
  std::vector<char> frames;
  std::vector<char> points3D;

  bool Any() const { return !frames.empty() || !points3D.empty(); }
  bool HasFrame(int32_t f) const { return !frames.empty() && frames[f] != 0; }
  bool HasPoint(int32_t k) const {
    return !points3D.empty() && points3D[k] != 0;
  }
};

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

}  // namespace krot
