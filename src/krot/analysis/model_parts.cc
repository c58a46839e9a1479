#include "krot/analysis/model_parts.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Core>

#include "krot/analysis/noise.h"
#include "krot/base/disjoint_sets.h"
#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry/transform.h"
#include "krot/linear/small_matrices.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix37 = Eigen::Matrix<double, 3, 7>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;

// Frames that share so many tracks are not told apart.
constexpr int64_t kManyTracks = 50;
// A part is weak if three of its standard deviations are above a tenth of the
// cameras' radius.
constexpr double kWeakSigma = 0.1 / 3;
// Eigenvalues of a matrix with ones on its diagonal: less holds nothing.
constexpr double kHoldsNothing = 1e-9;

// The frames, or groups of frames, that see each track; ascending.
using Sights = std::vector<std::vector<int32_t>>;

struct Link {
  int32_t a, b;  // a < b
  int64_t num_tracks;
};

// All pairs that share tracks, those that share most first.
std::vector<Link> LinksOf(const Sights& sights, int32_t count) {
  std::vector<std::vector<int32_t>> tracks_of(count);
  for (size_t k = 0; k < sights.size(); ++k) {
    for (const int32_t n : sights[k]) {
      tracks_of[n].push_back(static_cast<int32_t>(k));
    }
  }
  std::vector<Link> links;
  std::vector<int64_t> shared(count, 0);
  for (int32_t a = 0; a < count; ++a) {
    for (const int32_t k : tracks_of[a]) {
      for (const int32_t b : sights[k]) ++shared[b];
    }
    for (int32_t b = a + 1; b < count; ++b) {
      if (shared[b] > 0) links.push_back({a, b, shared[b]});
    }
    std::fill(shared.begin(), shared.end(), 0);
  }
  std::stable_sort(
      links.begin(), links.end(),
      [](const Link& x, const Link& y) { return x.num_tracks > y.num_tracks; });
  return links;
}

Vector3d MeanOf(const std::vector<Vector3d>& places) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& place : places) mean += place;
  return mean / static_cast<double>(std::max<size_t>(1, places.size()));
}

class PartFinder {
 public:
  PartFinder(const Model& model, const ModelNoise& noise)
      : model_(model),
        noise_(noise),
        geometries_(ImageGeometries(model)),
        image_of_(ImagesOfElements(model)) {
    std::vector<Vector3d> centers;
    for (const ImageGeometry& geometry : geometries_) {
      if (geometry.has_pose) centers.push_back(Center(geometry.cam_from_world));
    }
    const Vector3d middle = MeanOf(centers);
    double sum = 0;
    for (const Vector3d& center : centers) {
      sum += (center - middle).squaredNorm();
    }
    radius_ = std::sqrt(sum / static_cast<double>(centers.size()));
  }

  std::vector<ModelPart> Run() {
    Group();
    std::vector<ModelPart> parts = Separate();
    for (size_t cut = 0; cut < tree_.size(); ++cut) {
      const std::vector<char> is_part = SmallerSide(cut);
      if (NumFrames(is_part) < 2) continue;
      ModelPart part = PartOf(is_part);
      if (part.relative_center_sigma > kWeakSigma) {
        parts.push_back(std::move(part));
      }
    }
    std::stable_sort(parts.begin(), parts.end(),
                     [](const ModelPart& a, const ModelPart& b) {
                       return a.images.size() > b.images.size();
                     });
    return parts;
  }

 private:
  template <typename Visit>
  void ForEachTested(const Point3D& point, const Visit& visit) const {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (noise_.observations[e].num_controlled == 0) continue;
      const int32_t frame = geometries_[image_of_[e]].frame;
      visit(e, frame);
    }
  }

  // Unites frames that share many tracks, and spans a forest of what is left.
  void Group() {
    const auto num_frames = static_cast<int32_t>(model_.frames.size());
    Sights sights;
    for (const Point3D& point : model_.points3D) {
      std::vector<int32_t>& frames = sights.emplace_back();
      ForEachTested(point,
                    [&](uint64_t, int32_t frame) { frames.push_back(frame); });
      SortUnique(&frames);
    }
    DisjointSets sets(num_frames);
    for (const Link& link : LinksOf(sights, num_frames)) {
      if (link.num_tracks < kManyTracks) break;
      sets.Unite(link.a, link.b);
    }
    // Frames without tracks are in no group.
    std::vector<int32_t> group_of_root(num_frames, -1);
    group_of_.assign(num_frames, -1);
    for (const std::vector<int32_t>& frames : sights) {
      for (const int32_t f : frames) {
        int32_t& group = group_of_root[sets.Find(f)];
        if (group < 0) group = num_groups_++;
        group_of_[f] = group;
      }
    }
    for (std::vector<int32_t>& seen : sights) {
      for (int32_t& n : seen) n = group_of_[n];
      SortUnique(&seen);
      if (seen.size() < 2) seen.clear();
    }
    DisjointSets joined(num_groups_);
    for (const Link& link : LinksOf(sights, num_groups_)) {
      if (joined.Find(link.a) == joined.Find(link.b)) continue;
      joined.Unite(link.a, link.b);
      tree_.push_back(link);
    }
    for (int32_t g = 0; g < num_groups_; ++g) {
      component_of_.push_back(static_cast<int32_t>(joined.Find(g)));
    }
    for (size_t k = 0; k < sights.size(); ++k) {
      if (!sights[k].empty()) AddSights(k);
    }
  }

  // What each group's observations of a track say about its point.
  struct Sight {
    int32_t group = 0;
    Matrix3d H = Matrix3d::Zero();
  };
  struct SharedTrack {
    Vector3d x;
    std::vector<Sight> sights;
  };

  void AddSights(size_t k) {
    SharedTrack track{noise_.points[k], {}};
    ForEachTested(model_.points3D[k], [&](uint64_t e, int32_t frame) {
      const int32_t n = image_of_[e];
      const Point2D& pixel =
          model_.images[n].points2D[model_.track_elements[e].point2D_idx];
      const RigidTransform& pose = geometries_[n].cam_from_world;
      const Vector3d x_cam = pose * track.x;
      const auto E = RowAtProjection(model_.cameras[geometries_[n].camera],
                                     {pixel.x, pixel.y}, x_cam);
      if (!E) return;
      const Eigen::Matrix<double, 2, 3> J =
          (E->bottomRows<2>() -
           E->bottomRows<2>() * x_cam / E->row(0).dot(x_cam) * E->row(0)) /
          E->row(0).dot(x_cam) * pose.rotation;
      if (!J.allFinite()) return;
      const int32_t group = group_of_[frame];
      auto sight =
          std::find_if(track.sights.begin(), track.sights.end(),
                       [&](const Sight& one) { return one.group == group; });
      if (sight == track.sights.end()) {
        sight = track.sights.insert(sight, Sight{group, Matrix3d::Zero()});
      }
      sight->H += J.transpose() * J;
    });
    if (track.sights.size() > 1) shared_.push_back(std::move(track));
  }

  int64_t NumFrames(const std::vector<char>& is_part) const {
    return std::count_if(group_of_.begin(), group_of_.end(),
                         [&](int32_t g) { return g >= 0 && is_part[g] != 0; });
  }

  // The components, but for the one with the most frames: nothing holds them.
  std::vector<ModelPart> Separate() const {
    std::vector<std::pair<int64_t, std::vector<char>>> all;
    for (int32_t c = 0; c < num_groups_; ++c) {
      if (component_of_[c] != c) continue;
      std::vector<char> is_part;
      for (const int32_t other : component_of_) is_part.push_back(other == c);
      const int64_t count = NumFrames(is_part);
      all.emplace_back(count, std::move(is_part));
    }
    SortLargestFirst(&all, &std::pair<int64_t, std::vector<char>>::first);
    std::vector<ModelPart> parts;
    for (size_t n = 1; n < all.size(); ++n) {
      ModelPart& part = parts.emplace_back();
      part.images = ImagesOf(all[n].second);
      part.center_sigma = part.relative_center_sigma = kInfinity;
    }
    return parts;
  }

  // The groups on the side of a link with fewer frames.
  std::vector<char> SmallerSide(size_t cut) const {
    DisjointSets sets(num_groups_);
    for (size_t n = 0; n < tree_.size(); ++n) {
      if (n != cut) sets.Unite(tree_[n].a, tree_[n].b);
    }
    const auto side = [&](int32_t of) {
      std::vector<char> is_part;
      for (int32_t g = 0; g < num_groups_; ++g) {
        is_part.push_back(sets.Find(g) == sets.Find(of));
      }
      return is_part;
    };
    std::vector<char> a = side(tree_[cut].a), b = side(tree_[cut].b);
    return NumFrames(b) <= NumFrames(a) ? b : a;
  }

  bool IsIn(const std::vector<char>& is_part, size_t n) const {
    const ImageGeometry& geometry = geometries_[n];
    return geometry.has_pose && group_of_[geometry.frame] >= 0 &&
           is_part[group_of_[geometry.frame]] != 0;
  }

  std::vector<int32_t> ImagesOf(const std::vector<char>& is_part) const {
    std::vector<int32_t> images;
    for (size_t n = 0; n < geometries_.size(); ++n) {
      if (IsIn(is_part, n)) images.push_back(static_cast<int32_t>(n));
    }
    return images;
  }

  // Whether rigs give both sides a scale.
  bool HasScales(const std::vector<char>& is_part) const {
    bool has[2] = {false, false};
    for (size_t n = 0; n < geometries_.size(); ++n) {
      const ImageGeometry& geometry = geometries_[n];
      if (!geometry.has_pose || group_of_[geometry.frame] < 0) continue;
      has[IsIn(is_part, n)] |= !geometry.cam_from_rig.translation.isZero(0);
    }
    return has[0] && has[1];
  }

  ModelPart PartOf(const std::vector<char>& is_part) const {
    ModelPart part;
    part.images = ImagesOf(is_part);
    std::vector<Vector3d> centers;
    for (const int32_t n : part.images) {
      centers.push_back(Center(geometries_[n].cam_from_world));
    }
    const Vector3d origin = MeanOf(centers);
    const bool has_scales = HasScales(is_part);
    const auto motion = [&](const Vector3d& x) {
      Matrix37 K;
      K << Matrix3d::Identity(), -CrossMatrix(x - origin), x - origin;
      if (has_scales) K.col(6).setZero();
      return K;
    };
    Matrix7 M = Matrix7::Zero(), D = Matrix7::Zero();
    for (const SharedTrack& track : shared_) {
      Matrix3d H_a = Matrix3d::Zero(), H_b = Matrix3d::Zero();
      for (const Sight& sight : track.sights) {
        (is_part[sight.group] != 0 ? H_a : H_b) += sight.H;
      }
      if (H_a.isZero(0) || H_b.isZero(0)) continue;
      ++part.num_tracks;
      const Matrix3d root = RootOfInverse(H_a + H_b);
      const Matrix37 K = motion(track.x);
      M += K.transpose() * H_a * root * root.transpose() * H_b * K;
    }
    for (const Vector3d& center : centers) {
      const Matrix37 K = motion(center);
      D += K.transpose() * K / static_cast<double>(centers.size());
    }
    const double sigma =
        *noise_.sigma_px * SpreadOf((M + M.transpose()) / 2, D);
    part.center_sigma = sigma;
    part.relative_center_sigma = radius_ > 0 ? sigma / radius_ : 0;
    return part;
  }

  // sqrt(tr(D M^-1)); infinite if that is much and nothing holds it.
  double SpreadOf(const Matrix7& M, const Matrix7& D) const {
    Eigen::Matrix<double, 7, 1> scale = M.diagonal().cwiseSqrt();
    for (double& s : scale) s = s > 0 ? 1 / s : 1;
    const Eigenpairs of_M =
        EigenpairsOf(scale.asDiagonal() * M * scale.asDiagonal());
    double held = 0, loose = 0;
    for (int j = 0; j < 7; ++j) {
      const Eigen::VectorXd step = scale.asDiagonal() * of_M.vectors.col(j);
      const double moved = step.dot(D * step);
      if (of_M.values[j] > kHoldsNothing) {
        held += moved / of_M.values[j];
      } else {
        loose += moved / kHoldsNothing;
      }
    }
    return std::sqrt(loose) * *noise_.sigma_px > kWeakSigma * radius_
               ? kInfinity
               : std::sqrt(held + loose);
  }

  const Model& model_;
  const ModelNoise& noise_;
  const std::vector<ImageGeometry> geometries_;
  const std::vector<int32_t> image_of_;  // by track element
  double radius_ = 0;                    // of the cameras, scene units
  std::vector<int32_t> group_of_;        // by frame; -1: without tracks
  int32_t num_groups_ = 0;
  std::vector<int32_t> component_of_;  // by group
  std::vector<Link> tree_;             // between groups
  std::vector<SharedTrack> shared_;    // that several groups see
};

}  // namespace

LastingFaults FindLastingFaults(const Model& model) {
  LastingFaults faults;
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  const double least = LeastDistance(geometries);
  DisjointSets sets(static_cast<int64_t>(model.frames.size()));
  std::vector<char> has_track(model.frames.size(), 0);
  for (const Point3D& point : model.points3D) {
    int32_t first = -1;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const ImageGeometry& geometry = geometries[image_of[e]];
      if (!geometry.has_pose) continue;
      faults.num_in_camera +=
          (point.xyz - Center(geometry.cam_from_world)).norm() < least;
      if (first < 0) first = geometry.frame;
      sets.Unite(first, geometry.frame);
      has_track[first] = has_track[geometry.frame] = 1;
    }
  }
  std::vector<int64_t> num_images(model.frames.size(), 0);
  int64_t most = 0;
  for (const ImageGeometry& geometry : geometries) {
    if (!geometry.has_pose || has_track[geometry.frame] == 0) continue;
    int64_t& count = num_images[sets.Find(geometry.frame)];
    faults.num_parts += count++ == 0;
    ++faults.num_images;
    most = std::max(most, count);
  }
  faults.num_images_outside = faults.num_images - most;
  return faults;
}

std::vector<ModelPart> FindLooseParts(const Model& model,
                                      const ModelNoise& noise) {
  return PartFinder(model, noise).Run();
}

}  // namespace krot::internal
