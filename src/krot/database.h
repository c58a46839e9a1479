#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/context.h"
#include "krot/geometry.h"
#include "krot/model.h"

namespace krot {

// ---- COLMAP's database ----
// The matches of two images that COLMAP has verified: the inliers of an
// essential matrix, a fundamental matrix or a homography.
struct VerifiedPair {
  int32_t image1 = -1;  // index in Model::images
  int32_t image2 = -1;  // likewise; another image
  // COLMAP's configuration: 2 calibrated, 3 uncalibrated, 4 planar,
  // 5 panoramic, 6 planar or panoramic, 8 multiple, 9 calibrated rig.
  int config = 0;
  // Indices of keypoints of image1 and of image2; not empty.
  std::vector<std::array<uint32_t, 2>> matches;
};

// What COLMAP's database contains about a model's images.
struct Database {
  // For each of Model::images, in pixels as in Point2D; empty if the database
  // does not have the image, or has no keypoints of it.
  std::vector<std::vector<Eigen::Vector2d>> keypoints;
  // The scale of each 2D point's keypoint, pixels, for each of Model::images;
  // empty if the database has no scales, or other keypoints than these.
  std::vector<std::vector<float>> scales;
  // The pairs whose images are both in the model, in the order of COLMAP's pair
  // ids.
  std::vector<VerifiedPair> pairs;
  int64_t num_images = 0;  // images of the model that the database has, too
  int64_t num_other_pairs = 0;  // with an image that the model does not have
  int64_t num_watermarks = 0;   // pairs that COLMAP calls watermarks
};

// Reads a database of COLMAP 3.8 to 4.x. Images are matched by name; their ids
// in database and model may differ. If the model has as many 2D points of an
// image as the database has keypoints, the pixels of the model are used,
// because its photos may have been undistorted after the keypoints were found.
//
// Nothing is written. A COLMAP that is working on the database does not have to
// wait: the file is opened read-only, and without locks if neither its
// write-ahead log nor its journal holds anything.
//
// Throws ModelError if the database cannot be read, contradicts itself, has
// none of the model's images, or holds other features than the model. Tells
// `note` how many of the model's images are missing. Takes the time of reading
// the tables keypoints and two_view_geometries.
Database ReadDatabase(const std::filesystem::path& path, const Model& model,
                      const std::function<void(const std::string&)>& note = {});

// Writes a database of COLMAP 3.8, which later versions read, too. It holds the
// model's cameras and images with these keypoints and pairs, but no
// descriptors. An existing file is replaced once the new one is complete. The
// format stores keypoints as 32-bit floats. Throws WriteError.
void WriteDatabase(const std::filesystem::path& path, const Model& model,
                   const Database& contents);

// ---- Its matches against poses ---- Compares the verified matches of a
// database with the poses of a model. COLMAP's mapper drops the matches that
// contradict its poses, so the evidence against a pose is in the database
// alone.

enum class PairState {
  kKept,           // at least half of the matches agree with the poses
  kContradictory,  // fewer than a quarter do
  kUndecided,      // anything between
  kNotChecked  // fewer than 15 matches have rays, an image has no pose, or both
               // cameras are in one place or both cameras in one place
};

// What is wrong with the pose of a wrong image.
enum class PoseFault {
  kNone,      // the image is not wrong
  kPosition,  // moved, the image agrees with most of its matches
  kRotation,  // turned, the image agrees with most of its matches
  kUnclear    // moving and turning help equally, or neither does
};

struct CheckedPair {
  int32_t image1 = -1;  // index in Model::images
  int32_t image2 = -1;
  int64_t num_matches = 0;  // matches whose pixels have rays
  // Matches within the tolerance of their epipolar lines.
  int64_t num_agreeing = 0;
  double median_error_px = 0;  // Sampson's distance; NaN if not checked
  PairState state = PairState::kNotChecked;

  // For contradictory pairs only: can another baseline explain the matches,
  // with the rotations as they are? num_explained matches agree with
  // best_baseline; no baseline explains more than most_explained. The two are
  // equal, which is a proof, unless the search ended early. If they are small,
  // a rotation is wrong, or the matches are. If they are large, the position
  // may be wrong, but so may be a rotation by a degree or less, which looks
  // like a shift within one pair.
  int64_t num_explained = 0;
  int64_t most_explained = 0;
  Eigen::Vector3d best_baseline = Eigen::Vector3d::Zero();  // world axes
  // The proof of most_explained: the cells of baseline directions that cover
  // the half sphere (docs/formats.md, "Baselines").
  std::string cells;
  // The pair is contradictory, neither image is wrong, and the images are not
  // in different groups (PairCheck::groups).
  bool has_wrong_matches = false;
};

struct CheckedImage {
  ImageId image_id = 0;
  std::string name;
  int64_t num_kept = 0;  // pairs
  int64_t num_contradictory = 0;
  int64_t num_undecided = 0;
  int64_t kept_matches = 0;  // in the kept pairs
  int64_t contradictory_matches = 0;
  bool is_wrong = false;

  // For wrong images only: num_matches counts the matches with images that are
  // not wrong; the other two count those that agree once this image is moved,
  // or turned, to where they fit best. If an image is both moved and turned,
  // its rotation is wrong, and neither count is high.
  PoseFault fault = PoseFault::kNone;
  int64_t num_matches = 0;
  int64_t num_agreeing_moved = 0;
  int64_t num_agreeing_turned = 0;
  double moved_by = 0;  // in the model's unit
  double turned_by_deg = 0;
  RigidTransform moved_cam_from_world;  // the pose after moving
  // True if no baselines at all make a quarter of the matches in its
  // contradictory pairs agree: its rotation is wrong, whatever its position.
  bool is_rotation_proved_wrong = false;
};

// A set of wrong images that explains all contradictions: the kept pairs of
// these images are then worthless, and the matches of all other contradictory
// pairs are wrong.
struct Explanation {
  std::vector<int32_t> images;  // ascending
  // The number of matches that must be given up: those of each wrong image's
  // kept pairs (none for images that fit better moved or turned), and those of
  // the contradictory pairs between the other images.
  int64_t cost = 0;
};

struct PairCheck {
  std::vector<CheckedPair> pairs;    // as Database::pairs
  std::vector<CheckedImage> images;  // as Model::images
  double noise_px = 0;  // sigma per axis and keypoint, from the better pairs
  double tolerance_px = 0;  // of a match's error, to agree
  int64_t num_kept = 0;     // pairs
  int64_t num_contradictory = 0;
  int64_t num_undecided = 0;
  int64_t num_not_checked = 0;
  // Matches with a pixel that has no ray within 90 degrees of the axis.
  int64_t num_without_ray = 0;
  Explanation cheapest;
  // Another explanation that costs at most a tenth more, not counting what both
  // give up: the matches cannot tell the two apart.
  std::optional<Explanation> runner_up;
  // False if the search for the explanations ended early: there may be cheaper
  // ones.
  bool is_cheapest_proved = true;
  // Groups of two or more images that are not wrong, largest first. Kept pairs
  // connect the images within a group; between groups there are only
  // contradictory and undecided pairs. Empty unless a contradictory pair lies
  // between two such groups.
  std::vector<std::vector<int32_t>> groups;

  bool IsAnythingWrong() const;
};

// Measures the distance of each match from the epipolar lines of the model's
// poses, in true pixels, through the cameras' lenses. The tolerance follows
// from the noise of the better pairs. An image is wrong if the cheapest
// explanation says so and at least three of its pairs are decided, unless a
// quarter of its matches agree with its pose and no other pose fits them
// better. An image is also wrong if another pose halves the sum of its squared
// errors. Not seen: repeated structures whose wrong matches agree with wrong
// poses, and motion along epipolar lines.
//
// Requires a valid model and a database that was read for it. Same bits at any
// number of threads. O(matches), and milliseconds for each contradictory pair.
PairCheck CheckPairs(const Model& model, const Database& database,
                     const Context& context = {});

}  // namespace krot
