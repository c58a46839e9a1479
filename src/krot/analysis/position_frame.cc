#include "krot/analysis/position_frame.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <random>
#include <utility>

#include <Eigen/Eigenvalues>

#include "krot/analysis/model_comparison.h"
#include "krot/base/numbers.h"
#include "krot/context.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int64_t kMostTriples = 50'000;
constexpr size_t kMostScored = 300;
// The distance that one of a thousand exceeds, by the median: of a Gaussian in
// three dimensions.
constexpr double kFarByMedian = 2.6;
constexpr int kMaxRefits = 20;
// Positions scatter by this at least, relative to their size: those of a
// synthetic scene may be exact.
constexpr double kLeastScatter = 1e-6;
// Places this near to a line, relative to its length, are on it.
constexpr double kOnLine = 3e-5;
// The standard deviation of a turn about the line that is too large, radians.
constexpr double kLooseTurn = 1.0 / 3;

// A position of what the model places. `pose.center1` is the position, from the
// median of all, and `pose.center2` the model's place, likewise.
struct FramePair {
  size_t index = 0;
  PosePair pose;
  Matrix3d unit_from_own = Matrix3d::Identity();
};

std::vector<PosePair> PosesOf(const std::vector<FramePair>& pairs) {
  std::vector<PosePair> poses;
  for (const FramePair& pair : pairs) poses.push_back(pair.pose);
  return poses;
}

Vector3d OffsetAt(const Similarity& own_from_model, const FramePair& pair) {
  return own_from_model * pair.pose.center2 - pair.pose.center1;
}

// Distances by radii, or as they are where radii are unknown.
std::vector<double> MisfitsOf(const std::vector<FramePair>& pairs,
                              const Similarity& own_from_model) {
  std::vector<double> misfits;
  for (const FramePair& pair : pairs) {
    misfits.push_back(
        (pair.unit_from_own * OffsetAt(own_from_model, pair)).norm());
  }
  return misfits;
}

std::vector<FramePair> Within(const std::vector<FramePair>& pairs,
                              const std::vector<double>& misfits,
                              double tolerance) {
  std::vector<FramePair> within;
  for (size_t n = 0; n < pairs.size(); ++n) {
    if (misfits[n] <= tolerance) within.push_back(pairs[n]);
  }
  return within;
}

// Both lower is better.
struct Judgement {
  double score = kInfinity;
  double tolerance = 1;  // misfits below it agree
};

Judgement JudgeByRadii(const std::vector<double>& misfits) {
  Judgement judgement{0, 1};
  for (const double misfit : misfits) {
    judgement.score += std::min(misfit * misfit, 1.0);
  }
  return judgement;
}

// By the misfit that a majority does not exceed, of at least four where there
// are as many: three places always fit a little.
Judgement JudgeBySpread(std::vector<double> misfits) {
  const size_t count =
      std::max(misfits.size() / 2 + 1, std::min<size_t>(misfits.size(), 4));
  std::nth_element(misfits.begin(), misfits.begin() + (count - 1),
                   misfits.end());
  return {misfits[count - 1], kFarByMedian * misfits[count - 1]};
}

class FrameSearch {
 public:
  using Judge = std::function<Judgement(const std::vector<double>&)>;

  FrameSearch(const std::vector<FramePair>& pairs, Judge judge)
      : pairs_(pairs), judge_(std::move(judge)) {}

  // None if all triples are on a line.
  std::optional<Similarity> Run() {
    const size_t n = pairs_.size();
    if (n * (n - 1) / 2 * (n - 2) / 3 <= kMostTriples) {
      for (size_t a = 0; a < n; ++a) {
        for (size_t b = a + 1; b < n; ++b) {
          for (size_t c = b + 1; c < n; ++c) Try(a, b, c);
        }
      }
    } else {
      std::mt19937_64 generator(1);
      for (int64_t triple = 0; triple < kMostTriples; ++triple) {
        const size_t a = generator() % n;
        const size_t b = generator() % n;
        const size_t c = generator() % n;
        if (a != b && b != c && c != a) Try(a, b, c);
      }
    }
    return best_;
  }

 private:
  void Try(size_t a, size_t b, size_t c) {
    const auto found =
        AlignCenters({pairs_[a].pose, pairs_[b].pose, pairs_[c].pose});
    if (!found || !(found->scale > 0)) return;
    if (Take(*found)) Refine();
  }

  bool Take(const Similarity& own_from_model) {
    const Judgement judgement = judge_(MisfitsOf(pairs_, own_from_model));
    if (!(judgement.score < judgement_.score)) return false;
    judgement_ = judgement;
    best_ = own_from_model;
    return true;
  }

  // On what agrees with the best, and on twice as far: three places say less
  // than all of them.
  void Refine() {
    for (int refit = 0; refit < kMaxRefits; ++refit) {
      bool is_better = false;
      for (const double factor : {2.0, 1.0}) {
        const auto refined = AlignCenters(PosesOf(Within(
            pairs_, MisfitsOf(pairs_, *best_), factor * judgement_.tolerance)));
        if (refined && refined->scale > 0) is_better |= Take(*refined);
      }
      if (!is_better) return;
    }
  }

  const std::vector<FramePair>& pairs_;
  const Judge judge_;
  Judgement judgement_;
  std::optional<Similarity> best_;
};

// At most kMostScored of them, always the same.
std::vector<FramePair> Sample(std::vector<FramePair> pairs) {
  if (pairs.size() <= kMostScored) return pairs;
  std::mt19937_64 generator(2);
  for (size_t n = 0; n < kMostScored; ++n) {
    std::swap(pairs[n], pairs[n + generator() % (pairs.size() - n)]);
  }
  pairs.resize(kMostScored);
  return pairs;
}

std::optional<Similarity> Search(const std::vector<FramePair>& pairs,
                                 bool has_radii) {
  const std::vector<FramePair> sample = Sample(pairs);
  if (has_radii) {
    const auto found = FrameSearch(sample, JudgeByRadii).Run();
    if (!found) return std::nullopt;
    const auto agreeing = Within(sample, MisfitsOf(sample, *found), 1);
    if (2 * agreeing.size() > sample.size() && agreeing.size() >= 3) {
      return found;
    }
  }
  return FrameSearch(sample, JudgeBySpread).Run();
}

Vector3d MedianOf(const std::vector<FramePair>& pairs,
                  Vector3d PosePair::*center) {
  Vector3d median;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const FramePair& pair : pairs) {
      values.push_back((pair.pose.*center)[axis]);
    }
    median[axis] = LowerMedian(std::move(values));
  }
  return median;
}

// How far places lie from their best line and along it, root mean squares.
struct LineFit {
  double along = 0;
  double beside = 0;
};

LineFit FitLine(const std::vector<FramePair>& pairs) {
  const double count = static_cast<double>(pairs.size());
  Vector3d mean = Vector3d::Zero();
  for (const FramePair& pair : pairs) mean += pair.pose.center2 / count;
  Matrix3d covariance = Matrix3d::Zero();
  for (const FramePair& pair : pairs) {
    const Vector3d offset = pair.pose.center2 - mean;
    covariance += offset * offset.transpose() / count;
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(covariance);
  const Vector3d variances = solver.eigenvalues().cwiseMax(0);
  return {std::sqrt(variances[2]), std::sqrt(variances[0] + variances[1])};
}

std::string NameOf(const Model& model, const KnownPosition& position) {
  return position.of == KnownPosition::Of::kImage
             ? model.images[position.index].name
             : "3D point " + std::to_string(model.points3D[position.index].id);
}

// Of two significant digits.
std::string LengthText(double length) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.2g", length);
  return text;
}

class FrameFinder {
 public:
  FrameFinder(const Model& model, const std::vector<KnownPosition>& positions,
              const std::string& source)
      : model_(model), positions_(positions), source_(source) {
    PairUp();
  }

  PositionFrame Run() {
    if (pairs_.size() < 3) {
      Fail("found " + std::to_string(pairs_.size()) +
           " positions of what the model places, expected three at least, "
           "which are not on one line");
    }
    const auto found = Search(pairs_, has_radii_);
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
    }
    if (pairs_.empty()) return;
    own_origin_ = MedianOf(pairs_, &PosePair::center1);
    model_origin_ = MedianOf(pairs_, &PosePair::center2);
    for (FramePair& pair : pairs_) {
      pair.pose.center1 -= own_origin_;
      pair.pose.center2 -= model_origin_;
    }
  }

  // Fits the similarity to what agrees with it until that stays the same.
  std::vector<FramePair> Settle() {
    std::vector<double> misfits = MisfitsOf(pairs_, own_from_model_);
    std::vector<double> sizes;
    for (const FramePair& pair : pairs_) {
      sizes.push_back(pair.pose.center1.norm());
    }
    const double least = has_radii_ ? 1 : kLeastScatter * Median(sizes);
    tolerance_ = std::max(least, JudgeBySpread(misfits).tolerance);
    std::vector<FramePair> agreeing = Within(pairs_, misfits, tolerance_);
    for (int refit = 0; refit < kMaxRefits; ++refit) {
      const auto refined = AlignCenters(PosesOf(agreeing));
      if (!refined || !(refined->scale > 0)) break;
      own_from_model_ = *refined;
      misfits = MisfitsOf(pairs_, own_from_model_);
      // Three equations of each position, seven unknowns.
      const double equations = 3 * static_cast<double>(agreeing.size());
      tolerance_ = std::max(
          least, kFarByMedian * std::sqrt(equations / (equations - 7)) *
                     Median(MisfitsOf(agreeing, own_from_model_)));
      std::vector<FramePair> next = Within(pairs_, misfits, tolerance_);
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
    const LineFit line = FitLine(agreeing);
    const double along = own_from_model_.scale * line.along;
    const double beside = own_from_model_.scale * line.beside;
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
    if (!(beside > kOnLine * along) ||
        sigma > kLooseTurn * beside * std::sqrt(count)) {
      FailOnLine(beside);
    }
  }

  Vector3d InModel(const Vector3d& own) const {
    return model_origin_ +
           own_from_model_.rotation.transpose() *
               (own - own_origin_ - own_from_model_.translation) /
               own_from_model_.scale;
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
    std::stable_sort(
        frame.wrong.begin(), frame.wrong.end(),
        [](const auto& a, const auto& b) { return a.distance > b.distance; });
    for (size_t n = 0; n < positions_.size(); ++n) {
      if (is_wrong[n] != 0) continue;
      KnownPosition position = positions_[n];
      Ellipsoid& region = position.region;
      if (frame.radius) region.semi_axes.setConstant(*frame.radius);
      region.centre = InModel(region.centre);
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
  // Of the centred places.
  Similarity own_from_model_;
  double tolerance_ = 1;
};

}  // namespace

PositionFrame FindPositionFrame(const Model& model,
                                const std::vector<KnownPosition>& positions,
                                const std::string& source) {
  return FrameFinder(model, positions, source).Run();
}

}  // namespace krot::internal
