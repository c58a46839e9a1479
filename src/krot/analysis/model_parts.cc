#include "krot/analysis/noise.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Core>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry/transform.h"
#include "krot/linear/blocks.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix37 = Eigen::Matrix<double, 3, 7>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;

// Tracks that several frames of both sides see compare place, turn and scale:
// so many of them hold any part.
constexpr int64_t kManyTracks = 50;
// A part is weak if three of its standard deviations are above a tenth of the
// cameras' radius.
constexpr double kWeakSigma = 0.1 / 3;
// Eigenvalues of a matrix with ones on its diagonal: less holds nothing.
constexpr double kHoldsNothing = 1e-9;

// Two frames, and how many tracks both see.
struct Link {
  int32_t a, b;  // a < b
  int64_t num_tracks;
};

Vector3d MeanOf(const std::vector<Vector3d>& places) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& place : places) mean += place;
  return mean / static_cast<double>(std::max<size_t>(1, places.size()));
}

// A maximum spanning forest of the frames, joined by the tracks that they
// share.
class FrameForest {
 public:
  // Keeps references.
  FrameForest(const Model& model, const ModelNoise& noise,
              const std::vector<ImageGeometry>& geometries)
      : model_(model),
        noise_(noise),
        geometries_(geometries),
        image_of_(ImagesOfElements(model)) {
    const auto num_frames = static_cast<int32_t>(model_.frames.size());
    tracks_of_.resize(num_frames);
    for (size_t k = 0; k < model_.points3D.size(); ++k) {
      ForEachTested(k, [&](uint64_t, int32_t frame) {
        std::vector<size_t>& tracks = tracks_of_[frame];
        if (tracks.empty() || tracks.back() != k) tracks.push_back(k);
      });
    }
    std::vector<Link> links;
    std::vector<int64_t> shared(num_frames);
    for (int32_t a = 0; a < num_frames; ++a) {
      std::fill(shared.begin(), shared.end(), 0);
      for (const size_t k : tracks_of_[a]) {
        ForEachTested(k, [&](uint64_t, int32_t b) { ++shared[b]; });
      }
      for (int32_t b = a + 1; b < num_frames; ++b) {
        if (shared[b] > 0) links.push_back({a, b, shared[b]});
      }
    }
    std::stable_sort(links.begin(), links.end(),
                     [](const Link& x, const Link& y) {
                       return x.num_tracks > y.num_tracks;
                     });
    DisjointSets joined(num_frames);
    for (const Link& link : links) {
      if (joined.Find(link.a) == joined.Find(link.b)) continue;
      joined.Unite(link.a, link.b);
      links_.push_back(link);
    }
    for (int32_t f = 0; f < num_frames; ++f) {
      component_of_.push_back(
          tracks_of_[f].empty() ? -1 : static_cast<int32_t>(joined.Find(f)));
    }
  }

  // visit(element, frame) for each observation of point k that is tested.
  template <typename Visit>
  void ForEachTested(size_t k, const Visit& visit) const {
    const Point3D& point = model_.points3D[k];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (noise_.observations[e].num_controlled == 0) continue;
      visit(e, geometries_[image_of_[e]].frame);
    }
  }

  int32_t image_of(uint64_t e) const { return image_of_[e]; }
  bool HasTracks(int32_t frame) const { return component_of_[frame] >= 0; }
  size_t num_links() const { return links_.size(); }

  static int64_t NumFrames(const std::vector<char>& is_part) {
    return std::count(is_part.begin(), is_part.end(), 1);
  }

  // The trees, those with the most frames first.
  std::vector<std::vector<char>> Trees() const {
    std::vector<std::pair<int64_t, std::vector<char>>> all;
    for (size_t f = 0; f < component_of_.size(); ++f) {
      const auto root = static_cast<int32_t>(f);
      if (component_of_[f] != root) continue;
      std::vector<char> is_part;
      for (const int32_t other : component_of_) {
        is_part.push_back(other == root ? 1 : 0);
      }
      const int64_t count = NumFrames(is_part);
      all.emplace_back(count, std::move(is_part));
    }
    SortLargestFirst(&all, &std::pair<int64_t, std::vector<char>>::first);
    std::vector<std::vector<char>> trees;
    for (auto& [count, is_part] : all) trees.push_back(std::move(is_part));
    return trees;
  }

  // The frames on the side of a link with fewer of them.
  std::vector<char> SmallerSide(size_t cut) const {
    DisjointSets sets(static_cast<int64_t>(component_of_.size()));
    for (size_t n = 0; n < links_.size(); ++n) {
      if (n != cut) sets.Unite(links_[n].a, links_[n].b);
    }
    const auto side = [&](int32_t of) {
      std::vector<char> is_part;
      const int64_t root = sets.Find(of);
      for (size_t f = 0; f < component_of_.size(); ++f) {
        is_part.push_back(sets.Find(static_cast<int64_t>(f)) == root ? 1 : 0);
      }
      return is_part;
    };
    std::vector<char> a = side(links_[cut].a), b = side(links_[cut].b);
    return NumFrames(b) <= NumFrames(a) ? b : a;
  }

  // Whether so many tracks compare the sides that they hold both; looks at
  // those of the two frames that share most.
  bool IsWellTied(const std::vector<char>& is_part, size_t cut) const {
    int64_t count = 0;
    for (const size_t k : tracks_of_[links_[cut].a]) {
      int32_t first[2] = {-1, -1};
      bool is_located[2] = {false, false};
      ForEachTested(k, [&](uint64_t, int32_t frame) {
        const int side = is_part[frame];
        is_located[side] |= first[side] >= 0 && first[side] != frame;
        first[side] = frame;
      });
      count += is_located[0] && is_located[1];
      if (count >= kManyTracks) return true;
    }
    return false;
  }

 private:
  const Model& model_;
  const ModelNoise& noise_;
  const std::vector<ImageGeometry>& geometries_;
  const std::vector<int32_t> image_of_;         // by track element
  std::vector<std::vector<size_t>> tracks_of_;  // by frame
  std::vector<Link> links_;                     // of the forest
  std::vector<int32_t> component_of_;           // by frame; -1: without tracks
};

class PartFinder {
 public:
  PartFinder(const Model& model, const ModelNoise& noise)
      : model_(model),
        noise_(noise),
        geometries_(ImageGeometries(model)),
        forest_(model, noise, geometries_) {
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
    std::vector<ModelPart> parts;
    const std::vector<std::vector<char>> trees = forest_.Trees();
    for (size_t n = 1; n < trees.size(); ++n) {  // nothing holds them
      ModelPart& part = parts.emplace_back();
      part.images = ImagesOf(trees[n]);
      part.center_sigma = part.relative_center_sigma = kInfinity;
    }
    for (size_t cut = 0; cut < forest_.num_links(); ++cut) {
      const std::vector<char> is_part = forest_.SmallerSide(cut);
      if (FrameForest::NumFrames(is_part) < 2) continue;
      if (forest_.IsWellTied(is_part, cut)) continue;
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
  bool HasTracks(const ImageGeometry& geometry) const {
    return geometry.has_pose && forest_.HasTracks(geometry.frame);
  }

  std::vector<int32_t> ImagesOf(const std::vector<char>& is_part) const {
    std::vector<int32_t> images;
    for (size_t n = 0; n < geometries_.size(); ++n) {
      const ImageGeometry& geometry = geometries_[n];
      if (HasTracks(geometry) && is_part[geometry.frame] != 0) {
        images.push_back(static_cast<int32_t>(n));
      }
    }
    return images;
  }

  // Whether rigs give both sides a scale.
  bool HasScales(const std::vector<char>& is_part) const {
    bool has[2] = {false, false};
    for (const ImageGeometry& geometry : geometries_) {
      if (!HasTracks(geometry)) continue;
      has[static_cast<int>(is_part[geometry.frame])] |=
          !geometry.cam_from_rig.translation.isZero(0);
    }
    return has[0] && has[1];
  }

  // J'J, with J the derivatives of the pixel by its point.
  Matrix3d InformationOf(uint64_t e, size_t k) const {
    const int32_t n = forest_.image_of(e);
    const Point2D& pixel =
        model_.images[n].points2D[model_.track_elements[e].point2D_idx];
    const RigidTransform& pose = geometries_[n].cam_from_world;
    const Vector3d x_cam = pose * noise_.points[k];
    const auto projected =
        DifferentiateError(model_.cameras[geometries_[n].camera], pixel, x_cam);
    if (!projected) return Matrix3d::Zero();
    const Eigen::Matrix<double, 2, 3> J = projected->by_cam * pose.rotation;
    if (!J.allFinite()) return Matrix3d::Zero();
    return J.transpose() * J;
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
    for (size_t k = 0; k < model_.points3D.size(); ++k) {
      bool has[2] = {false, false};
      forest_.ForEachTested(k, [&](uint64_t, int32_t frame) {
        has[static_cast<int>(is_part[frame])] = true;
      });
      if (!has[0] || !has[1]) continue;
      ++part.num_tracks;
      Matrix3d H[2] = {Matrix3d::Zero(), Matrix3d::Zero()};
      forest_.ForEachTested(k, [&](uint64_t e, int32_t frame) {
        H[static_cast<int>(is_part[frame])] += InformationOf(e, k);
      });
      const Matrix3d root = RootOfInverse(H[0] + H[1]);
      const Matrix37 K = motion(noise_.points[k]);
      M += K.transpose() * H[0] * root * root.transpose() * H[1] * K;
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
  const FrameForest forest_;
  double radius_ = 0;  // of the cameras, scene units
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
