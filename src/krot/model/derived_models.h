#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/model.h"
#include "krot/model/model_io.h"

namespace krot::internal {

// A point, and how many observations it has.
struct TrackLength {
  Point3DId id;
  uint64_t length;
};

// Divides a model's points among `count` processes, with about as many
// observations each. Every process gets consecutive points in the order of
// their ids; they are returned as indices, ascending. O(points log points).
std::vector<std::vector<int32_t>> CutPoints(
    const std::vector<TrackLength>& tracks, int count);
std::vector<std::vector<int32_t>> CutPoints(const Model& whole, int count);

// The model's cameras, rigs, frames and images, without 2D points and tracks.
Model WithoutPoints(const Model& model);

// A model with some of the points: with their tracks and the 2D points that
// these name, and with everything else of the whole model.
struct ModelShare {
  Model model;
  // For each image: the index that each of its 2D points has in the whole
  // model.
  std::vector<std::vector<uint32_t>> point2D_of;
};

// Makes the part of one process; `points` as CutPoints gives them. Requires a
// valid model (ValidateModel).
ModelShare TakeShare(const Model& whole, const std::vector<int32_t>& points);

// Reads the share of one of `count` processes from a folder of binary files:
// TakeShare of the whole model, of which no more is in memory than the share,
// one image's 2D points, and some 30 bytes for every point. None if only the
// whole model tells what is to be done: if it is text, or if anything in the
// share is not as in a valid model (ValidateModel) that agrees with itself
// (FindContradictions) and whose 2D points are all finite. If every process
// gets a share, nothing in the whole is. O(bytes of the files): each process
// reads points3D twice.
std::optional<ModelShare> ReadShare(const std::filesystem::path& folder,
                                    int count, int rank);

struct RemovedObservations {
  Model model;
  std::vector<uint64_t> element_of;  // index of each track element in the input
  // Elements that were removed because fewer than two of their track were left.
  int64_t num_left_alone = 0;
  int64_t num_points = 0;  // points that were removed for that reason
};

// A copy of `model` without the track elements that `is_removed` marks, and
// without the points that keep fewer than two elements; if `drops_short` is
// false, only those of them that lose one. 2D points that no longer belong to a
// track name no 3D point. All images and 2D points stay, in the same order.
// Requires a valid model; throws std::invalid_argument unless there is one mark
// per element.
RemovedObservations RemoveObservations(const Model& model,
                                       const std::vector<char>& is_removed,
                                       bool drops_short = true);

// Whether a camera is a panorama.
bool HasPanorama(const Model& model);

// A copy without the images that `is_removed` marks, in the order of
// Model::images, as if they had never been registered. A frame is removed with
// its last image; cameras and rigs stay. No track may hold a removed image.
// Throws std::invalid_argument unless there is one mark per image.
Model RemoveImages(const Model& model, const std::vector<char>& is_removed);

// A frame whose origin O is amid the model, at a round number. It helps with
// coordinates of 10^6 to 10^7 m, as in UTM or ECEF: these leave few digits for
// the scene in differences of R s and t, and rotations about a distant origin
// are badly conditioned unknowns. x_local = x - O is exact for points; t_local
// = t + R O is rounded once.
class LocalFrame {
 public:
  // O is near the median of the fixed and known positions; without any, of all
  // finite camera centres; without these, of the points. If that median is not
  // farther from the origin than 10 times the positions' median distance from
  // it, O is zero, and everything below only copies. Requires a valid model.
  // O(images + points).
  explicit LocalFrame(const Model& model, const FixedParts& fixed = {},
                      const std::vector<KnownPosition>& known = {});

  const Eigen::Vector3d& origin() const { return origin_; }
  // Whether the local frame is the model's own.
  bool IsModels() const { return origin_.isZero(0); }

  // The model in the local frame.
  Model ToLocal(const Model& model) const;
  std::vector<KnownPosition> ToLocal(std::vector<KnownPosition> known) const;

  // Brings a model back that began as ToLocal(before). What has not changed
  // gets the bits that it has in `before`. Requires the same images and frames;
  // points may be missing.
  Model FromLocal(const Model& before, const Model& local) const;

 private:
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
};

// Calls solve() in the local frame, and brings the `model` in its result back.
template <typename Solve>
auto InLocalFrame(const LocalFrame& frame, const Model& model,
                  const Solve& solve) {
  if (frame.IsModels()) return solve(model);
  auto result = solve(frame.ToLocal(model));
  result.model = frame.FromLocal(model, result.model);
  return result;
}

}  // namespace krot::internal
