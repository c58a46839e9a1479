#pragma once

#include <cstdint>
#include <string>

#include "krot/model.h"
#include "krot/model/file_bytes.h"

namespace krot::internal {

// What a file of rotations did to a model.
struct ReplacedRotations {
  int64_t num_frames = 0;       // that it names
  int64_t num_kept_images = 0;  // of frames that it does not name
  // Whether the model's frames have rotations of their own, not all the same.
  bool is_comparable = false;
  // By how much the images that it names turn, degrees.
  double median_turn_deg = 0;
  double largest_turn_deg = 0;
  std::string largest_turn_image;
  // The file's world frame is turned against the model's by so much, which was
  // taken off.
  double frame_turn_deg = 0;
  // Why the file is probably written in another convention, with the cure; ""
  // if it is not.
  std::string mistake;
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
// A file that names all frames, and whose rotations agree with the model's own
// much better after a rotation of the world, is of another world frame: its
// rotations are turned into the model's. One that agrees much better still
// with its numbers in another order, or inverted, is a mistake, probably: they
// are taken as they stand, and `mistake` says so.
// A frame that had no rotation gets one, and has no translation. Images that
// the model does not have are skipped, and `note` told.
//
// Requires a valid model, and leaves one. Throws ModelError, with the line, for
// what is no such line, for a name that two images bear or that the file has
// twice, and for a file that names no image of the model; the model is to be
// thrown away then. O(file + images).
ReplacedRotations ReplaceRotations(const FileBytes& file, Model* model,
                                   const FileNote& note = {});

}  // namespace krot::internal
