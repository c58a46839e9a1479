#pragma once

#include <cstdint>

#include "krot/model/file_bytes.h"
#include "krot/model/model.h"

namespace krot {

// How far a file of rotations reached.
struct ReplacedRotations {
  int64_t num_frames = 0;       // that it names
  int64_t num_kept_images = 0;  // of frames that it does not name
};

// Replaces the rotations of the frames that a text file names (gyroscopes,
// gimbals, other pipelines: docs/formats.md). A line holds an image's name,
// which may have blanks in it, and the last four of its words, QW QX QY QZ,
// that image's rotation, camera from world; of any length but zero. It gives
// the frame its rotation, through the sensor's place in the rig; where several
// images of a frame are named, they have to agree to 1e-5 rad, and the first
// decides. Frames keep their place, -R' t; those without a line, or with the
// rotation that they have, keep their bits.
//
// Requires a valid model, and leaves one. Throws ModelError, with the line, for
// what is no such line, for an image that the model does not have or has twice,
// or that the file names twice, and for a file without lines; the model is to
// be thrown away then. O(file + images).
ReplacedRotations ReplaceRotations(const FileBytes& file, Model* model);

}  // namespace krot
