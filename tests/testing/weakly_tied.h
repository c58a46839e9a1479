#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"

namespace krot::internal {

// The same model with so few tracks between two parts: `part_of` says which
// part an image is of, by its index, and `are_tied` which two parts share
// tracks. Of the tracks of two such parts, each with two observations or more
// on either side, the first `num_tracks` stay, and the second part's
// observations of the first `num_wrong` of these go to random pixels. All other
// tracks keep their observations in the part that sees most of them.
inline Model WeaklyTied(Model model, const std::function<int(int)>& part_of,
                        const std::function<bool(int, int)>& are_tied,
                        int num_tracks, int num_wrong) {
  std::map<ImageId, int> index_of;
  for (size_t n = 0; n < model.images.size(); ++n) {
    index_of[model.images[n].id] = static_cast<int>(n);
  }
  std::mt19937 random(3);
  std::map<std::pair<int, int>, int> num_kept;
  std::vector<char> is_removed(model.track_elements.size(), 0);
  for (const Point3D& point : model.points3D) {
    std::map<int, std::vector<uint64_t>> elements;  // by part
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      elements[part_of(index_of[model.track_elements[e].image_id])].push_back(
          e);
    }
    std::set<int> kept;
    for (const auto& [a, of_a] : elements) {
      for (const auto& [b, of_b] : elements) {
        if (!kept.empty() || a >= b || !are_tied(a, b)) continue;
        if (of_a.size() < 2 || of_b.size() < 2) continue;
        int& count = num_kept[{a, b}];
        if (count == num_tracks) continue;
        kept = {a, b};
        if (++count > num_wrong) continue;
        for (const uint64_t e : of_b) {
          const TrackElement& element = model.track_elements[e];
          Point2D& pixel = model.images[index_of[element.image_id]]
                               .points2D[element.point2D_idx];
          pixel.x = std::uniform_real_distribution<double>(0, 1024)(random);
          pixel.y = std::uniform_real_distribution<double>(0, 768)(random);
        }
      }
    }
    if (kept.empty()) {
      const auto largest = std::max_element(
          elements.begin(), elements.end(), [](const auto& x, const auto& y) {
            return x.second.size() < y.second.size();
          });
      kept = {largest->first};
    }
    for (const auto& [part, own] : elements) {
      if (kept.count(part) > 0) continue;
      for (const uint64_t e : own) is_removed[e] = 1;
    }
  }
  return RemoveObservations(model, is_removed).model;
}

// Turns the rotations of images that `is_turned` says, by their index, and of
// the frames of the same index, about the world's y axis.
inline void TurnPart(const std::function<bool(int)>& is_turned, double degrees,
                     Model* model) {
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(degrees * M_PI / 180, Eigen::Vector3d::UnitY())
          .toRotationMatrix();
  const auto turned = [&](const Pose& pose) {
    return ToPose({pose.Rotation() * turn, pose.translation});
  };
  for (size_t n = 0; n < model->images.size(); ++n) {
    if (!is_turned(static_cast<int>(n))) continue;
    Pose& pose = model->images[n].cam_from_world;
    pose = turned(pose);
    if (n < model->frames.size()) {
      Pose& of_frame = model->frames[n].rig_from_world;
      of_frame = turned(of_frame);
    }
  }
}

}  // namespace krot::internal
