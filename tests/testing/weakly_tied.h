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

// The same with tracks of two: of every track the first two images stay, by
// their indices, of which `is_pair` says so; tracks without such two go.
inline Model OfPairs(const Model& model,
                     const std::function<bool(int, int)>& is_pair) {
  std::map<ImageId, int> index_of;
  for (size_t n = 0; n < model.images.size(); ++n) {
    index_of[model.images[n].id] = static_cast<int>(n);
  }
  std::vector<char> is_removed(model.track_elements.size(), 1);
  for (const Point3D& point : model.points3D) {
    std::map<int, uint64_t> element_of;  // by image
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      element_of[index_of[model.track_elements[e].image_id]] = e;
    }
    bool has_pair = false;
    for (const auto& [a, of_a] : element_of) {
      for (const auto& [b, of_b] : element_of) {
        if (has_pair || a >= b || !is_pair(a, b)) continue;
        is_removed[of_a] = is_removed[of_b] = 0;
        has_pair = true;
      }
    }
  }
  return RemoveObservations(model, is_removed).model;
}

inline Model ChainOfPairs(const Model& model) {
  return OfPairs(model, [](int a, int b) { return b == a + 1; });
}

// What images at other poses would see, with noise: `pose_of` says where the
// image of an index is instead, and its frame. What would be behind it goes.
// Requires PINHOLE cameras and one for each frame.
inline Model SeenFrom(
    Model model,
    const std::function<RigidTransform(int, const RigidTransform&)>& pose_of,
    double noise_px) {
  std::map<ImageId, int> index_of;
  for (size_t n = 0; n < model.images.size(); ++n) {
    const auto own = static_cast<int>(n);
    index_of[model.images[n].id] = own;
    Pose& pose = model.images[n].cam_from_world;
    pose = ToPose(pose_of(own, pose.Transform()));
    if (n < model.frames.size()) model.frames[n].rig_from_world = pose;
  }
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, noise_px);
  std::vector<char> is_removed;
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model.track_elements[e];
      Image& image = model.images[index_of[element.image_id]];
      const Eigen::Vector3d x = image.cam_from_world.Transform() * point.xyz;
      const std::vector<double>& params = model.cameras[0].params;
      Point2D& pixel = image.points2D[element.point2D_idx];
      pixel.x = params[0] * x[0] / x[2] + params[2] + noise(random);
      pixel.y = params[1] * x[1] / x[2] + params[3] + noise(random);
      is_removed.push_back(!(x[2] > 0));
    }
  }
  return RemoveObservations(model, is_removed).model;
}

// Of the baselines this share is left, around the first image. For SeenFrom.
inline std::function<RigidTransform(int, const RigidTransform&)> NearTheFirst(
    const Model& model, double share) {
  const Eigen::Vector3d first =
      Center(model.images[0].cam_from_world.Transform());
  return [first, share](int, const RigidTransform& own) {
    const Eigen::Vector3d centre = first + share * (Center(own) - first);
    return RigidTransform{own.rotation, -(own.rotation * centre)};
  };
}

}  // namespace krot::internal
