#include "krot/analysis/model_comparison.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <unordered_map>

#include "krot/analysis/noise.h"
#include "krot/base/numbers.h"
#include "krot/geometry.h"
#include "krot/geometry/transform.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

Matrix3Xd Centers(const std::vector<PosePair>& poses,
                  Vector3d PosePair::*center) {
  Matrix3Xd centers(3, poses.size());
  for (size_t n = 0; n < poses.size(); ++n) centers.col(n) = poses[n].*center;
  return centers;
}

double Radius(const Matrix3Xd& centers) {
  if (centers.cols() == 0) return 0;
  const Vector3d centroid = centers.rowwise().mean();
  return (centers.colwise() - centroid).norm() /
         std::sqrt(static_cast<double>(centers.cols()));
}

// The chordal mean of R1' R2.
std::optional<Matrix3d> MeanRotation(const std::vector<PosePair>& poses) {
  Matrix3d sum = Matrix3d::Zero();
  for (const PosePair& pose : poses) {
    sum += pose.cam_from_world1_rotation.transpose() *
           pose.cam_from_world2_rotation;
  }
  return NearestRotation(sum);
}

bool AreEqual(const PosePair& pose) {
  return pose.cam_from_world1_rotation == pose.cam_from_world2_rotation &&
         pose.center1 == pose.center2;
}

bool IsIdentity(const Similarity& similarity) {
  return similarity.scale == 1 && similarity.rotation == Matrix3d::Identity() &&
         similarity.translation == Vector3d::Zero();
}

// Camera coordinates grow with the world: scale (R x2 + t) = R' x1 + t'.
void Transform(const Similarity& world1_from_world2, Pose* cam_from_world) {
  const Eigen::Quaterniond rotated =
      NormalizedQuaternion(cam_from_world->quaternion_wxyz) *
      Eigen::Quaterniond(world1_from_world2.rotation).conjugate();
  cam_from_world->quaternion_wxyz = ToWxyz(rotated);
  cam_from_world->translation =
      world1_from_world2.scale * cam_from_world->translation -
      rotated * world1_from_world2.translation;
}

}  // namespace

double AngleDeg(const Matrix3d& A, const Matrix3d& B) {
  // The chord |A - B|_F = 2 sqrt(2) sin(angle / 2): the trace is blind to
  // small angles.
  const double sine = (A - B).norm() / std::sqrt(8.0);
  return 2 * std::asin(std::min(1.0, sine)) * kDegreesPerRadian;
}

std::vector<PosePair> HeldPoses(const std::vector<PosePair>& poses) {
  const std::optional<Matrix3d> rotation = MeanRotation(poses);
  if (!rotation) return poses;
  std::vector<CameraMove> cameras;
  for (const PosePair& pose : poses) {
    cameras.push_back({pose.center1, *rotation * pose.center2, pose.distance1,
                       pose.distance2});
  }
  const std::vector<char> keeps =
      FindConsensus(cameras, /*scale_is_free=*/true);
  std::vector<PosePair> held;
  for (size_t n = 0; n < keeps.size(); ++n) {
    if (keeps[n] != 0) held.push_back(poses[n]);
  }
  return held;
}

double SceneRadius(const std::vector<PosePair>& poses) {
  return Radius(Centers(poses, &PosePair::center1));
}

std::optional<Similarity> AlignFrames(const std::vector<PosePair>& poses) {
  if (poses.empty()) return std::nullopt;
  const std::vector<PosePair> held = HeldPoses(poses);
  const std::optional<Matrix3d> rotation = MeanRotation(held);
  if (!rotation) return std::nullopt;

  const Matrix3Xd centers1 = Centers(held, &PosePair::center1);
  const Matrix3Xd centers2 = Centers(held, &PosePair::center2);
  const double radius1 = Radius(centers1);
  const double radius2 = Radius(centers2);
  Similarity similarity;
  similarity.rotation = *rotation;
  if (radius1 > 0 && radius2 > 0) similarity.scale = radius1 / radius2;
  similarity.translation =
      centers1.rowwise().mean() -
      similarity.scale * (*rotation * centers2.rowwise().mean());
  return similarity;
}

std::optional<Similarity> AlignCenters(const std::vector<PosePair>& poses) {
  if (poses.size() < 3) return std::nullopt;
  double weights = 0;
  for (const PosePair& pose : poses) weights += pose.weight;
  Vector3d mean1 = Vector3d::Zero();
  Vector3d mean2 = Vector3d::Zero();
  for (const PosePair& pose : poses) {
    mean1 += pose.weight * pose.center1 / weights;
    mean2 += pose.weight * pose.center2 / weights;
  }
  Matrix3d covariance = Matrix3d::Zero();
  double variance2 = 0;
  for (const PosePair& pose : poses) {
    const Vector3d offset2 = pose.center2 - mean2;
    covariance += pose.weight * (pose.center1 - mean1) * offset2.transpose();
    variance2 += pose.weight * offset2.squaredNorm();
  }
  const std::optional<Matrix3d> rotation = NearestRotation(covariance);
  if (!rotation) return std::nullopt;
  Similarity similarity;
  similarity.rotation = *rotation;
  similarity.scale = rotation->cwiseProduct(covariance).sum() / variance2;
  similarity.translation = mean1 - similarity.scale * (*rotation * mean2);
  return similarity;
}

std::optional<Similarity> Align(AlignmentKind kind,
                                const std::vector<PosePair>& poses) {
  if (kind == AlignmentKind::kNone) return Similarity();
  const std::optional<Similarity> similarity =
      kind == AlignmentKind::kFrame ? AlignFrames(poses) : AlignCenters(poses);
  const bool is_same = std::all_of(poses.begin(), poses.end(), &AreEqual);
  return similarity && is_same ? Similarity() : similarity;
}

namespace {

// Features do not lie this close to each other; files rounded to a few digits
// do not move them this far.
constexpr double kSamePixel = 0.01;

// For every 2D point of a model its elements in the tracks.
class TrackIndex {
 public:
  explicit TrackIndex(const Model& model)
      : model_(model),
        points_(PointsOfElements(model)),
        others_(model.track_elements.size()) {
    for (const Image& image : model.images) {
      elements_.emplace_back(image.points2D.size());
    }
    const std::vector<int32_t> image_of = ImagesOfElements(model);
    for (uint64_t e = 0; e < image_of.size(); ++e) {
      std::optional<uint64_t>& last =
          elements_[image_of[e]][model.track_elements[e].point2D_idx];
      others_[e] = last;
      last = e;
    }
  }

  // A track element of this 2D point, none if no track holds it.
  std::optional<uint64_t> Element(int32_t image, size_t point2D_idx) const {
    return elements_[image][point2D_idx];
  }

  // Another track element of the same 2D point; following these shows all.
  std::optional<uint64_t> Other(uint64_t element) const {
    return others_[element];
  }

  // Index in Model::points3D.
  int32_t Point(uint64_t element) const { return points_[element]; }

  Point3DId PointId(uint64_t element) const {
    return model_.points3D[points_[element]].id;
  }

 private:
  const Model& model_;
  std::vector<std::vector<std::optional<uint64_t>>> elements_;
  const std::vector<int32_t> points_;
  std::vector<std::optional<uint64_t>> others_;
};

// Pairs the track elements of a 2D point; e1 and e2 are the last ones of either
// model. If there is only one in each, they are a pair whatever their points
// are; otherwise those of points with the same id are.
void PairElements(const TrackIndex& index1, const TrackIndex& index2,
                  uint64_t e1, uint64_t e2, std::vector<ElementPair>* pairs) {
  if (!index1.Other(e1) && !index2.Other(e2)) {
    pairs->push_back({e1, e2});
    return;
  }
  for (std::optional<uint64_t> a = e1; a; a = index1.Other(*a)) {
    for (std::optional<uint64_t> b = e2; b; b = index2.Other(*b)) {
      if (index1.PointId(*a) != index2.PointId(*b)) continue;
      pairs->push_back({*a, *b});
      break;
    }
  }
}

std::vector<IndexPair> MatchImages(const Model& model1, const Model& model2) {
  auto by_name = ImagesByName(model2);
  std::vector<IndexPair> pairs;
  for (size_t n = 0; n < model1.images.size(); ++n) {
    const auto found = by_name.find(model1.images[n].name);
    if (found == by_name.end()) continue;
    pairs.push_back({static_cast<int32_t>(n), found->second});
    by_name.erase(found);
  }
  return pairs;
}

bool IsSamePixel(const Point2D& a, const Point2D& b) {
  return std::abs(a.x - b.x) <= kSamePixel && std::abs(a.y - b.y) <= kSamePixel;
}

std::vector<ElementPair> MatchObservations(const Model& model1,
                                           const Model& model2,
                                           const std::vector<IndexPair>& images,
                                           const TrackIndex& index1,
                                           const TrackIndex& index2) {
  std::vector<ElementPair> pairs;
  for (const IndexPair& pair : images) {
    const std::vector<Point2D>& a = model1.images[pair.first].points2D;
    const std::vector<Point2D>& b = model2.images[pair.second].points2D;
    for (size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
      if (!IsSamePixel(a[i], b[i])) continue;
      const std::optional<uint64_t> e1 = index1.Element(pair.first, i);
      const std::optional<uint64_t> e2 = index2.Element(pair.second, i);
      if (e1 && e2) PairElements(index1, index2, *e1, *e2, &pairs);
    }
  }
  return pairs;
}

// Two points, and how many observations they share.
struct Vote {
  IndexPair points;
  int64_t count = 0;
  bool has_same_id = false;
};

// One vote for every two points that share any, ordered by both indices.
std::vector<Vote> CountVotes(const Model& model1, const Model& model2,
                             const std::vector<ElementPair>& observations,
                             const TrackIndex& index1,
                             const TrackIndex& index2) {
  std::vector<std::pair<int32_t, int32_t>> pairs;
  pairs.reserve(observations.size());
  for (const ElementPair& observation : observations) {
    pairs.emplace_back(index1.Point(observation.first),
                       index2.Point(observation.second));
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<Vote> votes;
  for (const auto& [first, second] : pairs) {
    if (votes.empty() || votes.back().points.first != first ||
        votes.back().points.second != second) {
      votes.push_back(
          {{first, second},
           0,
           model1.points3D[first].id == model2.points3D[second].id});
    }
    ++votes.back().count;
  }
  return votes;
}

// For every point of one model, the index of its best vote; the earliest of
// equal ones.
std::unordered_map<int32_t, size_t> BestVotes(const std::vector<Vote>& votes,
                                              int32_t IndexPair::*point) {
  std::unordered_map<int32_t, size_t> best;
  for (size_t n = 0; n < votes.size(); ++n) {
    const Vote& vote = votes[n];
    const auto [it, is_first] = best.emplace(vote.points.*point, n);
    const Vote& leader = votes[it->second];
    if (!is_first && std::tie(vote.count, vote.has_same_id) >
                         std::tie(leader.count, leader.has_same_id)) {
      it->second = n;
    }
  }
  return best;
}

std::vector<IndexPair> MatchPoints(const std::vector<Vote>& votes) {
  const auto best1 = BestVotes(votes, &IndexPair::first);
  const auto best2 = BestVotes(votes, &IndexPair::second);
  std::vector<IndexPair> pairs;
  for (size_t n = 0; n < votes.size(); ++n) {
    const IndexPair& points = votes[n].points;
    if (best1.at(points.first) == n && best2.at(points.second) == n) {
      pairs.push_back(points);
    }
  }
  return pairs;
}

}  // namespace

ModelCorrespondence FindCorrespondence(const Model& model1,
                                       const Model& model2) {
  const TrackIndex index1(model1);
  const TrackIndex index2(model2);
  ModelCorrespondence correspondence;
  correspondence.images = MatchImages(model1, model2);
  correspondence.observations =
      MatchObservations(model1, model2, correspondence.images, index1, index2);
  correspondence.points = MatchPoints(
      CountVotes(model1, model2, correspondence.observations, index1, index2));
  return correspondence;
}

}  // namespace krot::internal

namespace krot {

using namespace internal;

Model TransformModel(const Model& model, const Similarity& world1_from_world2) {
  Model result = model;
  if (IsIdentity(world1_from_world2)) return result;
  for (Rig& rig : result.rigs) {
    for (RigSensor& sensor : rig.sensors) {
      if (!sensor.sensor_from_rig) continue;
      sensor.sensor_from_rig->translation *= world1_from_world2.scale;
    }
  }
  for (Frame& frame : result.frames) {
    Transform(world1_from_world2, &frame.rig_from_world);
  }
  for (Image& image : result.images) {
    Transform(world1_from_world2, &image.cam_from_world);
  }
  for (Point3D& point : result.points3D) {
    point.xyz = world1_from_world2 * point.xyz;
  }
  return result;
}

}  // namespace krot
