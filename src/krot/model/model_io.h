#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/model.h"

namespace krot::internal {

// A file in memory, and its name for messages.
struct FileBytes {
  std::string path;
  std::string bytes;
};

// Receives a sentence on how a file was understood, for example on what was
// skipped; may be empty.
using FileNote = std::function<void(const std::string& sentence)>;

// Reads the whole file at once. Throws ModelError if it is missing, not a
// regular file or not readable, or if it is a Git LFS pointer instead of the
// file itself.
FileBytes ReadFileBytes(const std::filesystem::path& path);

// What ReadModel reads before the images: cameras, and rigs and frames if the
// folder has them. Throws ModelError.
Model ReadWithoutImages(const std::filesystem::path& folder,
                        ModelFormat format);
// Once there are images: makes rigs and frames if the files hold none.
void CompleteRigs(Model* model);

// The image names that COLMAP's text reader would cut at their first white
// space, in the order of the images. KROT reads them whole, so the user should
// be warned before they are written as text.
std::vector<std::string> ImageNamesWithWhiteSpace(const Model& model);

// Reads which images must not move, and marks their frames. The text file names
// one image per line or, if no image has such a name, its id; comments begin
// with #. An image may be listed twice. What the model does not have is
// skipped, and `note` is told. Requires a valid model. Throws ModelError, with
// the line, for a name that two images have and for an image without a pose;
// and if the file names nothing that the model has.
std::vector<char> FixedFrames(const FileBytes& file, const Model& model,
                              const FileNote& note = {});

// Likewise for 3D points, which the file lists by their ids.
std::vector<char> FixedPoints3D(const FileBytes& file, const Model& model,
                                const FileNote& note = {});

// Whether the region can be computed with: everything is finite, the quaternion
// is not zero, and the semi-axes are above zero and differ at most by a factor
// of 10^4.
bool IsFit(const Ellipsoid& region);

// Where a known position is given by its standard deviations, and where it is
// understood so, the semi-axes of its region are so many of them.
inline constexpr double kRegionSigmas = 3;

struct PositionsOptions {
  // For lines without a radius; > 0, scene units. None: such lines are refused.
  std::optional<double> radius;
  FileNote on_note = {};  // told what was skipped
  // The file has a frame and a unit of its own. Then any line may lack a
  // radius; it is returned as 0.
  bool has_own_frame = false;
};

// Reads the positions of images that a text file lists (GPS, surveys:
// docs/formats.md). A line holds an image's name, which may contain blanks, X Y
// Z, and either a RADIUS or three semi-axes. These are along the model's axes
// or, with QW QX QY QZ behind them, along axes that this rotation takes to the
// model's. Images that the model does not have are skipped. Requires a valid
// model. Throws ModelError, with the line, for any other line and for a name
// that two images have or that the file lists twice; if the file names no image
// of the model; and for latitudes and longitudes.
std::vector<KnownPosition> ReadPositions(const FileBytes& file,
                                         const Model& model,
                                         const PositionsOptions& options = {});

// Likewise for 3D points, by their ids.
std::vector<KnownPosition> ReadPointPositions(
    const FileBytes& file, const Model& model,
    const PositionsOptions& options = {});

// Whether the bytes begin like an SQLite database.
inline bool IsDatabase(const FileBytes& file) {
  return file.bytes.rfind("SQLite format 3", 0) == 0;
}

// Reads the pose priors in COLMAP's database (3.8 to 4.x) for the images of the
// model, which are found by name. Latitudes and longitudes (WGS84) are
// converted to metres east, north and up of one of them, the one nearest to
// their median; `options.on_note` is told. The region of a prior with an
// invertible covariance is the ellipsoid of three standard deviations, which
// the Gaussian leaves one time in thirty. Those of others are balls of
// options.radius, or of radius 0 without that. Priors that are not finite are
// skipped. Throws ModelError if there are no priors, if they use several
// coordinate systems, and for latitudes beyond a pole.
std::vector<KnownPosition> ReadPosePriors(const std::filesystem::path& path,
                                          const Model& model,
                                          const PositionsOptions& options);

// What ReplaceRotations did to a model.
struct ReplacedRotations {
  int64_t num_frames = 0;       // frames that the file names
  int64_t num_kept_images = 0;  // images of the other frames
  // Whether the model's frames had rotations of their own, not all the same.
  bool is_comparable = false;
  // By how much the images that the file names turn, degrees.
  double median_turn_deg = 0;
  double largest_turn_deg = 0;
  std::string largest_turn_image;
  // The angle between the world frames of the file and the model, which was
  // corrected; 0 if they are the same.
  double frame_turn_deg = 0;
  // Why the file probably uses another convention, and how to correct it; "" if
  // it does not.
  std::string mistake;
};

// Replaces the rotations of the frames that a text file names (from gyroscopes,
// gimbals, other pipelines: docs/formats.md). A line holds an image's name,
// which may contain blanks, and as its last four words QW QX QY QZ, the
// rotation of that image, camera from world, of any length but zero. The frame
// gets its rotation from that, through the sensor's pose in the rig. If several
// images of a frame are named, they must agree to 1e-5 rad, and the first one
// counts. Frames keep their place, -R' t; those without a line, or whose
// rotation does not change, keep their bits.
//
// If a file names all frames, and its rotations agree with the model's own much
// better after a rotation of the world, it uses another world frame: its
// rotations are turned into the model's. If they agree much better still with
// their numbers in another order, or inverted, the file is probably wrong: its
// rotations are used as they stand, and `mistake` says so. A frame that had no
// rotation gets one, but no translation. Images that the model does not have
// are skipped, and `note` is told.
//
// Requires a valid model, and leaves one. Throws ModelError, with the line, for
// any other line and for a name that two images have or that the file lists
// twice, and if the file names no image of the model; the model must not be
// used after that. O(file + images).
ReplacedRotations ReplaceRotations(const FileBytes& file, Model* model,
                                   const FileNote& note = {});

// ---- Known distances ----

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
