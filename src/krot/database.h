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

// What COLMAP's database says of a model's images.
struct Database {
  // Of each of Model::images, pixels as in Point2D; empty where the database
  // does not have the image, or no keypoints of it.
  std::vector<std::vector<Eigen::Vector2d>> keypoints;
  // Of each of Model::images and of its 2D points, the keypoint's scale,
  // pixels; empty where the database has none, or other keypoints than these.
  std::vector<std::vector<float>> scales;
  // Of pairs that the model has both images of, in the order of COLMAP's pair
  // ids.
  std::vector<VerifiedPair> pairs;
  int64_t num_images = 0;       // of the model that the database has, too
  int64_t num_other_pairs = 0;  // with an image that the model does not have
  int64_t num_watermarks = 0;   // pairs that COLMAP takes for watermarks
};

// Reads a database of COLMAP 3.8 to 4.x. Its images and the model's are the
// same if they have the same name; their ids may differ. Where the model has as
// many 2D points of an image as the database has keypoints, the keypoints are
// taken from the model, whose photos may have been undistorted since.
//
// Nothing is written, and a COLMAP that is at work on the database is not kept
// waiting: it is opened read-only, and without locks if neither its write-ahead
// log nor its journal holds anything.
//
// Throws ModelError if it cannot be read, contradicts itself, has none of the
// model's images, or is of other features than the model. Tells `note` how many
// of the model's images it does not have. The time of reading the tables
// keypoints and two_view_geometries.
Database ReadDatabase(const std::filesystem::path& path, const Model& model,
                      const std::function<void(const std::string&)>& note = {});

// Writes a database of COLMAP 3.8, which later versions read, too: the model's
// cameras and images with these keypoints and pairs, without descriptors. An
// existing file is replaced, once the new one is complete. Keypoints are 32-bit
// floats there. Throws WriteError.
void WriteDatabase(const std::filesystem::path& path, const Model& model,
                   const Database& contents);

// ---- Its matches against poses ----
// The verified matches of a database against the poses of a model. COLMAP's
// mapper drops the matches that contradict its poses: what speaks against a
// pose is in the database alone.

enum class PairState {
  kKept,           // at least half of the matches agree with the poses
  kContradictory,  // fewer than a quarter do
  kUndecided,      // anything between
  kNotChecked      // fewer than 15 matches have rays, an image without a pose,
                   // or both cameras in one place
};

// What is wrong with the pose of a wrong image.
enum class PoseFault {
  kNone,      // the image is not wrong
  kPosition,  // moved, it agrees with most of its matches
  kRotation,  // turned, it agrees with most of its matches
  kUnclear    // both help as much, or neither does
};

struct CheckedPair {
  int32_t image1 = -1;  // indices in Model::images
  int32_t image2 = -1;
  int64_t num_matches = 0;     // whose pixels have rays
  int64_t num_agreeing = 0;    // within the tolerance of their epipolar lines
  double median_error_px = 0;  // Sampson's distance; NaN if not checked
  PairState state = PairState::kNotChecked;

  // Of contradictory pairs: how many matches agree with the baseline that most
  // agree with, the rotations being as they are, and how many agree with any at
  // most. The two are equal, a proof, unless the search ended early. If it is
  // few, a rotation is wrong, or the matches are; if it is many, the position
  // may be wrong, but so may be a rotation by a degree or less, which in one
  // pair looks like a shift.
  int64_t num_explained = 0;
  int64_t most_explained = 0;
  Eigen::Vector3d best_baseline = Eigen::Vector3d::Zero();  // world axes
  // The proof of most_explained: the cells of directions that it takes
  // (docs/formats.md, "Baselines").
  std::string cells;
  // Neither image is wrong, and they are not of two groups.
  bool has_wrong_matches = false;
};

struct CheckedImage {
  ImageId image_id = 0;
  std::string name;
  int64_t num_kept = 0;  // pairs
  int64_t num_contradictory = 0;
  int64_t num_undecided = 0;
  int64_t kept_matches = 0;  // matches of these pairs
  int64_t contradictory_matches = 0;
  bool is_wrong = false;

  // Of wrong images: the matches with images that are not wrong, and how many
  // of them agree with the image once it is moved, or turned, to where it fits
  // them best. An image that is moved and turned has a wrong rotation, and
  // neither share is high.
  PoseFault fault = PoseFault::kNone;
  int64_t num_matches = 0;
  int64_t num_agreeing_moved = 0;
  int64_t num_agreeing_turned = 0;
  double moved_by = 0;  // model's unit
  double turned_by_deg = 0;
  RigidTransform moved_cam_from_world;  // the pose after the move
  // True if no baselines whatever would make a quarter of the matches of its
  // contradictory pairs agree: its rotation is wrong, whatever its position.
  bool is_rotation_proved_wrong = false;
};

// What may be wrong such that no contradiction is left: images, whose kept
// pairs are then worth nothing, and the matches of the contradictory pairs
// between all others.
struct Explanation {
  std::vector<int32_t> images;  // ascending
  // Matches that it gives up: of the wrong images' kept pairs, each image by
  // itself, none of images that fit better moved or turned, and of the
  // contradictory pairs between the others.
  int64_t cost = 0;
};

struct PairCheck {
  std::vector<CheckedPair> pairs;    // as Database::pairs
  std::vector<CheckedImage> images;  // as Model::images
  double noise_px = 0;  // sigma per axis and keypoint, of the better pairs
  double tolerance_px = 0;
  int64_t num_kept = 0;  // pairs
  int64_t num_contradictory = 0;
  int64_t num_undecided = 0;
  int64_t num_not_checked = 0;
  // Matches of which a pixel has no ray less than 90 degrees off the axis.
  int64_t num_without_ray = 0;
  Explanation cheapest;
  // Another explanation that costs at most a tenth more, what both give up left
  // out: the two cannot be told apart by the matches.
  std::optional<Explanation> runner_up;
  // False if the search for these ended early: cheaper ones may exist.
  bool is_cheapest_proved = true;
  // Images that are not called wrong, in groups of two and more, largest first:
  // kept pairs join the images of each, between the groups there are only
  // contradictory and undecided ones. Empty if there are no two such groups
  // with a contradictory pair between them.
  std::vector<std::vector<int32_t>> groups;

  bool IsAnythingWrong() const;
};

// Measures each match in true pixels, through the cameras' lenses, against the
// epipolar lines of the model's poses. The tolerance follows from the noise of
// the better pairs. An image is wrong if the cheapest explanation says so and
// it has at least three decided pairs, unless a quarter of its matches agree
// with its pose and no other fits them better; and if another pose halves the
// sum of its squared errors. What matches cannot see stays unseen: equal
// structures whose wrong matches agree with wrong poses, and motion along
// epipolar lines.
//
// Requires a valid model and a database read for it. Same bits at any number of
// threads. O(matches), and milliseconds for each contradictory pair.
PairCheck CheckPairs(const Model& model, const Database& database,
                     const Context& context = {});

}  // namespace krot
