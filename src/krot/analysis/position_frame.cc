#include "krot/analysis/model_input.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include <Eigen/Eigenvalues>

#include "krot/analysis/frame_search.h"
#include "krot/base/numbers.h"
#include "krot/context.h"
#include "krot/geometry/transform.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// The variances of the model's places along their principal axes, ascending.
Vector3d PrincipalVariances(const std::vector<FramePair>& pairs) {
  const double count = static_cast<double>(pairs.size());
  Vector3d mean = Vector3d::Zero();
  for (const FramePair& pair : pairs) mean += pair.pose.center2 / count;
  Matrix3d covariance = Matrix3d::Zero();
  for (const FramePair& pair : pairs) {
    const Vector3d offset = pair.pose.center2 - mean;
    covariance += offset * offset.transpose() / count;
  }
  return Eigen::SelfAdjointEigenSolver<Matrix3d>(covariance)
      .eigenvalues()
      .cwiseMax(0);
}

// With two significant digits.
std::string LengthText(double length) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.2g", length);
  return text;
}

class FrameFinder {
 public:
  FrameFinder(const Model& model, const std::vector<KnownPosition>& positions,
              const std::string& source)
      : model_(model), positions_(positions), source_(source) {}

  PositionFrame Run() {
    PairUp();
    const auto found = SearchFrame(pairs_, has_radii_);
    if (!found) FailOnLine(0);
    own_from_model_ = *found;
    const std::vector<FramePair> agreeing = Settle();
    CheckAgreement(agreeing);
    return Result(agreeing);
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw ModelError(source_ + ": " + what);
  }

  [[noreturn]] void FailOnLine(double beside) const {
    Fail("found positions on one line" +
         (beside > 0 ? ", to " + LengthText(beside) + " and their scatter,"
                     : std::string(",")) +
         " about which the model may be turned at will, expected some beside "
         "it; --point_positions_path adds those of points");
  }

  void PairUp() {
    const std::vector<ImageGeometry> geometries = ImageGeometries(model_);
    std::vector<Vector3d> own, in_model;
    for (size_t n = 0; n < positions_.size(); ++n) {
      const KnownPosition& position = positions_[n];
      FramePair pair;
      pair.index = n;
      pair.pose.center1 = position.region.centre;
      if (position.of == KnownPosition::Of::kPoint3D) {
        pair.pose.center2 = model_.points3D[position.index].xyz;
      } else if (geometries[position.index].has_pose) {
        pair.pose.center2 = Center(geometries[position.index].cam_from_world);
      } else {
        continue;
      }
      if (!pair.pose.center2.allFinite()) continue;
      if (position.region.semi_axes.minCoeff() > 0) {
        pair.unit_from_own = position.region.UnitFromWorld();
        pair.pose.weight = pair.unit_from_own.squaredNorm();
        has_radii_ = true;
      }
      pairs_.push_back(pair);
      own.push_back(pair.pose.center1);
      in_model.push_back(pair.pose.center2);
    }
    if (pairs_.size() < 3) {
      Fail("found " + std::to_string(pairs_.size()) +
           " positions of what the model places, expected three at least, "
           "which are not on one line");
    }
    own_origin_ = MedianPlace(own);
    model_origin_ = MedianPlace(in_model);
    for (FramePair& pair : pairs_) {
      pair.pose.center1 -= own_origin_;
      pair.pose.center2 -= model_origin_;
    }
  }

  // Fits the similarity to what agrees with it until that stays the same.
  std::vector<FramePair> Settle() {
    std::vector<double> sizes;
    for (const FramePair& pair : pairs_) {
      sizes.push_back(pair.pose.center1.norm());
    }
    // The positions of a synthetic scene may be exact.
    const double least = has_radii_ ? 1 : 1e-6 * Median(sizes);
    tolerance_ = std::max(
        least, JudgeBySpread(MisfitsOf(pairs_, own_from_model_)).tolerance);
    std::vector<FramePair> agreeing =
        Within(pairs_, own_from_model_, tolerance_);
    for (int refit = 0; refit < kMaxRefits; ++refit) {
      const auto refined = FitTo(agreeing);
      if (!refined) break;
      own_from_model_ = *refined;
      // Three equations for each position, seven unknowns.
      const double equations = 3 * static_cast<double>(agreeing.size());
      tolerance_ = std::max(
          least, kFarByMedian * std::sqrt(equations / (equations - 7)) *
                     Median(MisfitsOf(agreeing, own_from_model_)));
      std::vector<FramePair> next = Within(pairs_, own_from_model_, tolerance_);
      if (next.size() < 3) break;
      const bool is_same = std::equal(
          next.begin(), next.end(), agreeing.begin(), agreeing.end(),
          [](const auto& a, const auto& b) { return a.index == b.index; });
      if (is_same) break;
      agreeing = std::move(next);
    }
    return agreeing;
  }

  // Distances, in units of the positions.
  std::vector<double> DistancesOf(const std::vector<FramePair>& pairs) const {
    std::vector<double> distances;
    for (const FramePair& pair : pairs) {
      distances.push_back(OffsetAt(own_from_model_, pair).norm());
    }
    return distances;
  }

  void CheckAgreement(const std::vector<FramePair>& agreeing) const {
    const std::vector<double> distances = DistancesOf(agreeing);
    // How far places lie from their best line and along it, root mean squares.
    const Vector3d variances = PrincipalVariances(agreeing);
    const double along = own_from_model_.scale * std::sqrt(variances[2]);
    const double beside =
        own_from_model_.scale * std::sqrt(variances[0] + variances[1]);
    const double median = Median(distances);
    if (!(kFarByMedian * median < std::hypot(along, beside))) {
      Fail(
          "found positions that no similarity brings nearer to the model's "
          "than " +
          LengthText(median) +
          " (median), which is as far as they are from each other; expected "
          "those of these images");
    }
    double squares = 0;
    for (const double distance : distances) squares += distance * distance;
    const double count = static_cast<double>(agreeing.size());
    const double sigma = std::sqrt(squares / (3 * count - 7));
    // On the line up to rounding, or with a standard deviation of the turn
    // about it of more than a third, radians.
    if (!(beside > 3e-5 * along) || sigma > beside * std::sqrt(count) / 3) {
      FailOnLine(beside);
    }
  }

  PositionFrame Result(const std::vector<FramePair>& agreeing) const {
    PositionFrame frame;
    frame.own_from_model = own_from_model_;
    frame.own_from_model.translation +=
        own_origin_ -
        own_from_model_.scale * (own_from_model_.rotation * model_origin_);
    frame.num_compared = static_cast<int64_t>(pairs_.size());
    frame.median_distance = Median(DistancesOf(agreeing));
    frame.tolerance = tolerance_;
    if (!has_radii_) frame.radius = tolerance_;
    std::vector<char> is_wrong(positions_.size(), 0);
    for (const FramePair& pair : pairs_) is_wrong[pair.index] = 1;
    for (const FramePair& pair : agreeing) is_wrong[pair.index] = 0;
    for (const FramePair& pair : pairs_) {
      if (is_wrong[pair.index] == 0) continue;
      const Vector3d offset = OffsetAt(own_from_model_, pair);
      const double misfit = (pair.unit_from_own * offset).norm();
      frame.wrong.push_back({pair.index, NameOf(model_, positions_[pair.index]),
                             offset.norm(),
                             has_radii_ ? offset.norm() / misfit : tolerance_});
    }
    SortLargestFirst(&frame.wrong, &WrongPosition::distance);
    for (size_t n = 0; n < positions_.size(); ++n) {
      if (is_wrong[n] != 0) continue;
      KnownPosition position = positions_[n];
      Ellipsoid& region = position.region;
      if (frame.radius) region.semi_axes.setConstant(*frame.radius);
      region.centre = model_origin_ + own_from_model_.rotation.transpose() *
                                          (region.centre - own_origin_ -
                                           own_from_model_.translation) /
                                          own_from_model_.scale;
      region.semi_axes /= own_from_model_.scale;
      if (!region.IsBall()) {
        region.world_from_axes =
            Eigen::Quaterniond(own_from_model_.rotation).conjugate() *
            region.world_from_axes;
      }
      frame.positions.push_back(position);
    }
    return frame;
  }

  const Model& model_;
  const std::vector<KnownPosition>& positions_;
  const std::string source_;
  std::vector<FramePair> pairs_;
  bool has_radii_ = false;
  Vector3d own_origin_ = Vector3d::Zero();
  Vector3d model_origin_ = Vector3d::Zero();
  // Takes places relative to model_origin_ to positions relative to
  // own_origin_.
  Similarity own_from_model_;
  double tolerance_ = 1;
};

}  // namespace

std::string NameOf(const Model& model, const KnownPosition& position) {
  return position.of == KnownPosition::Of::kImage
             ? model.images[position.index].name
             : "3D point " + std::to_string(model.points3D[position.index].id);
}

std::vector<KnownPosition> InOwnFrame(const PositionFrame& frame) {
  const Similarity& own_from_model = frame.own_from_model;
  std::vector<KnownPosition> positions = frame.positions;
  for (KnownPosition& position : positions) {
    Ellipsoid& region = position.region;
    region.centre = own_from_model * region.centre;
    region.semi_axes *= own_from_model.scale;
    region.world_from_axes =
        Eigen::Quaterniond(own_from_model.rotation) * region.world_from_axes;
  }
  return positions;
}

PositionFrame FindPositionFrame(const Model& model,
                                const std::vector<KnownPosition>& positions,
                                const std::string& source) {
  return FrameFinder(model, positions, source).Run();
}

KnownPositions ReadKnownPositions(const PositionFiles& files,
                                  const Model& model, const FileNote& on_note) {
  const PositionsOptions options{files.radius, on_note, files.have_own_frame};
  KnownPositions known;
  if (!files.of_cameras.empty()) {
    const FileBytes file = ReadFileBytes(files.of_cameras);
    known.positions = options.has_own_frame && IsDatabase(file)
                          ? ReadPosePriors(files.of_cameras, model, options)
                          : ReadPositions(file, model, options);
  }
  if (!files.of_points.empty()) {
    const std::vector<KnownPosition> of_points =
        ReadPointPositions(ReadFileBytes(files.of_points), model, options);
    known.positions.insert(known.positions.end(), of_points.begin(),
                           of_points.end());
  }
  if (!options.has_own_frame) return known;
  known.frame = FindPositionFrame(
      model, known.positions,
      files.of_cameras.empty() ? files.of_points : files.of_cameras);
  known.positions = known.frame->positions;
  return known;
}

}  // namespace krot::internal
