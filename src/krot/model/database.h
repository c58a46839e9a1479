#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "krot/model/file_bytes.h"
#include "krot/model/model.h"

namespace krot {

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
                      const FileNote& note = {});

// Writes a database of COLMAP 3.8, which later versions read, too: the model's
// cameras and images with these keypoints and pairs, without descriptors. An
// existing file is replaced, once the new one is complete. Keypoints are 32-bit
// floats there. Throws WriteError.
void WriteDatabase(const std::filesystem::path& path, const Model& model,
                   const Database& contents);

}  // namespace krot
