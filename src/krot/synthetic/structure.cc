#include "krot/synthetic/structure.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "krot/base/check.h"

namespace krot::internal {
namespace {

class StructureSampler {
 public:
  StructureSampler(const SceneOptions& options, const Trajectory& trajectory,
                   const Imaging& imaging, Random* random)
      : options_(options),
        trajectory_(trajectory),
        imaging_(imaging),
        random_(random),
        offsets_(trajectory.neighbor_offsets) {}

  // Fills track_ with a point sampled from the image `anchor`; false if no
  // other image sees it.
  bool SamplePoint(int anchor) {
    track_.clear();
    const double across = random_->Uniform();
    const double down = random_->Uniform();
    const double depth =
        random_->Uniform(trajectory_.min_depth, trajectory_.max_depth);
    const std::optional<Eigen::Vector3d> point =
        imaging_.PointAt(anchor, {across, down}, depth);
    if (!point) return false;
    point_ = *point;
    CollectTrack(anchor, SampleTrackLength());
    return track_.size() >= 2;
  }

  const Eigen::Vector3d& point() const { return point_; }
  const std::vector<Sighting>& track() const { return track_; }

 private:
  // Uniform around the mean, as wide as [2, number of images] allows.
  size_t SampleTrackLength() {
    const double mean = options_.track_length;
    const double half_width = std::min(mean - 2, imaging_.num_images() - mean);
    const double length = mean + half_width * random_->Uniform(-1, 1);
    const double whole = std::floor(length);
    return static_cast<size_t>(whole) + random_->Chance(length - whole);
  }

  // The anchor and its frame's other images first, then neighbours in random
  // order.
  void CollectTrack(int anchor, size_t length) {
    const int num_sensors = options_.sensors_per_rig;
    const int num_frames = options_.num_frames;
    const int anchor_frame = anchor / num_sensors;
    AddSighting(anchor);
    AddFrame(anchor_frame, anchor, length);

    const size_t max_tries = std::min(offsets_.size(), 4 * length + 16);
    for (size_t n = 0; n < max_tries && track_.size() < length; ++n) {
      int frame = anchor_frame + DrawOffset(n);
      if (trajectory_.is_closed) frame = (frame + num_frames) % num_frames;
      if (frame < 0 || frame >= num_frames) continue;
      AddFrame(frame, anchor, length);
    }
  }

  // The n-th element of a random permutation (Fisher and Yates), which may
  // start from any order.
  int DrawOffset(size_t n) {
    const size_t rest = offsets_.size() - n;
    const size_t pick =
        n +
        static_cast<size_t>(random_->UniformInt(static_cast<int64_t>(rest)));
    std::swap(offsets_[n], offsets_[pick]);
    return offsets_[n];
  }

  void AddFrame(int frame, int anchor, size_t length) {
    for (int s = 0; s < options_.sensors_per_rig; ++s) {
      if (track_.size() >= length) return;
      const int image = frame * options_.sensors_per_rig + s;
      if (image != anchor) AddSighting(image);
    }
  }

  void AddSighting(int image) {
    const std::optional<Eigen::Vector2d> pixel =
        imaging_.Project(image, point_);
    if (pixel) track_.push_back({image, *pixel});
  }

  const SceneOptions options_;
  const Trajectory& trajectory_;
  const Imaging& imaging_;
  Random* const random_;
  std::vector<int> offsets_;
  Eigen::Vector3d point_;
  std::vector<Sighting> track_;
};

}  // namespace

Structure SampleStructure(const SceneOptions& options,
                          const Trajectory& trajectory, const Imaging& imaging,
                          Random* random) {
  constexpr int kMaxTries = 1000;
  StructureSampler sampler(options, trajectory, imaging, random);
  Structure structure;
  for (int k = 0; k < options.num_points; ++k) {
    const int anchor = k % imaging.num_images();
    int tries = 0;
    while (!sampler.SamplePoint(anchor)) {
      CheckArgument(++tries < kMaxTries, "rig_rotation_deg",
                    options.rig_rotation_deg,
                    "such that every image shares points with another");
    }
    structure.points.push_back(sampler.point());
    structure.sightings.insert(structure.sightings.end(),
                               sampler.track().begin(), sampler.track().end());
    structure.point_begin.push_back(
        static_cast<int64_t>(structure.sightings.size()));
  }
  return structure;
}

}  // namespace krot::internal
