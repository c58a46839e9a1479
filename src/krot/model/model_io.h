#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "krot/model.h"

namespace krot::internal {

// A file in memory, and its name for messages.
struct FileBytes {
  std::string path;
  std::string bytes;
};

// Takes a sentence on how a file was understood, on what was skipped, for one;
// may be empty.
using FileNote = std::function<void(const std::string& sentence)>;

// The whole file in one read. Throws ModelError if it is missing, not a
// regular file or not readable, or if it is a Git LFS pointer instead of the
// file that it stands for.
FileBytes ReadFileBytes(const std::filesystem::path& path);

// The image names that COLMAP's text reader would cut at their first white
// space, in the order of the images. KROT reads them whole; warn before
// writing them as text.
std::vector<std::string> ImageNamesWithWhiteSpace(const Model& model);

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

// Whether all is finite and the semi-axes are above zero and not too different
// for the digits of what is computed with them.
bool IsFit(const Ellipsoid& region);

struct PositionsOptions {
  // Of lines without one; > 0, scene units. None: such lines are refused.
  std::optional<double> radius;
  FileNote on_note = {};  // what was skipped
  // The file has a frame and a unit of its own. Then all lines may be without a
  // radius, which is 0 in what is returned.
  bool has_own_frame = false;
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
