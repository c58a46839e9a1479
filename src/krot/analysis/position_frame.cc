#include "krot/analysis/model_input.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include <Eigen/Eigenvalues>

#include "krot/analysis/model_comparison.h"
#include "krot/base/numbers.h"
#include "krot/geometry/transform.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// In units of the median distance: one of a thousand Gaussian errors in three
// dimensions is farther off.
constexpr double kFarByMedian = 2.6;
constexpr int kMaxRefits = 20;

// A known position, and where the model places it. `pose.center1` is the
// position, relative to the median of all positions; `pose.center2` is the
// model's place, relative to the median of all places.
struct FramePair {
  size_t index = 0;
  PosePair pose;
  Matrix3d unit_from_own = Matrix3d::Identity();
};

// The similarity that fits these pairs best; none if it is not determined.
std::optional<Similarity> FitTo(const std::vector<FramePair>& pairs) {
  std::vector<PosePair> poses;
  for (const FramePair& pair : pairs) poses.push_back(pair.pose);
  const std::optional<Similarity> fit = AlignCenters(poses);
  return fit && fit->scale > 0 ? fit : std::nullopt;
}

// The model's place, taken to the positions' frame, minus the position.
Vector3d OffsetAt(const Similarity& own_from_model, const FramePair& pair) {
  return own_from_model * pair.pose.center2 - pair.pose.center1;
}

// Distances in radii, or in the positions' unit where radii are unknown.
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
                              const Similarity& own_from_model,
                              double tolerance) {
  const std::vector<double> misfits = MisfitsOf(pairs, own_from_model);
  std::vector<FramePair> within;
  for (size_t n = 0; n < pairs.size(); ++n) {
    if (misfits[n] <= tolerance) within.push_back(pairs[n]);
  }
  return within;
}

// How well a similarity fits the positions; a lower score is better.
struct Judgement {
  double score = kInfinity;
  double tolerance = 1;  // misfits below it agree
};

Judgement JudgeByRadii(std::vector<double> misfits) {
  Judgement judgement{0, 1};
  for (const double misfit : misfits) {
    judgement.score += std::min(misfit * misfit, 1.0);
  }
  return judgement;
}

// The score is the misfit that a majority does not exceed: at least four where
// there are as many, since any three places nearly fit.
Judgement JudgeBySpread(std::vector<double> misfits) {
  const size_t count =
      std::max(misfits.size() / 2 + 1, std::min<size_t>(misfits.size(), 4));
  std::nth_element(misfits.begin(), misfits.begin() + (count - 1),
                   misfits.end());
  return {misfits[count - 1], kFarByMedian * misfits[count - 1]};
}

class FrameSearch {
 public:
  using Judge = Judgement (*)(std::vector<double>);

  FrameSearch(const std::vector<FramePair>& pairs, Judge judge)
      : pairs_(pairs), judge_(judge) {}

  // None if all triples are on a line.
  std::optional<Similarity> Run() {
    constexpr int64_t kMostTriples = 50'000;
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
    const auto found = FitTo({pairs_[a], pairs_[b], pairs_[c]});
    if (found && Take(*found)) Refine();
  }

  bool Take(const Similarity& own_from_model) {
    const Judgement judgement = judge_(MisfitsOf(pairs_, own_from_model));
    if (!(judgement.score < judgement_.score)) return false;
    judgement_ = judgement;
    best_ = own_from_model;
    return true;
  }

  // Fits the positions that agree with the best similarity, within the
  // tolerance or twice that, as three places say less than all of them.
  void Refine() {
    for (int refit = 0; refit < kMaxRefits; ++refit) {
      bool is_better = false;
      for (const double factor : {2.0, 1.0}) {
        const auto refined =
            FitTo(Within(pairs_, *best_, factor * judgement_.tolerance));
        if (refined) is_better |= Take(*refined);
      }
      if (!is_better) return;
    }
  }

  const std::vector<FramePair>& pairs_;
  const Judge judge_;
  Judgement judgement_;
  std::optional<Similarity> best_;
};

// At most 300 pairs, always the same.
std::vector<FramePair> Sample(std::vector<FramePair> pairs) {
  constexpr size_t kMostScored = 300;
  if (pairs.size() <= kMostScored) return pairs;
  std::mt19937_64 generator(2);
  for (size_t n = 0; n < kMostScored; ++n) {
    std::swap(pairs[n], pairs[n + generator() % (pairs.size() - n)]);
  }
  pairs.resize(kMostScored);
  return pairs;
}

// By consensus within the radii or, where these are unknown or no majority
// agrees, by the least median. None if all triples are on a line.
std::optional<Similarity> SearchFrame(const std::vector<FramePair>& pairs,
                                      bool has_radii) {
  const std::vector<FramePair> sample = Sample(pairs);
  if (has_radii) {
    const auto found = FrameSearch(sample, JudgeByRadii).Run();
    if (!found) return std::nullopt;
    const auto agreeing = Within(sample, *found, 1);
    if (2 * agreeing.size() > sample.size() && agreeing.size() >= 3) {
      return found;
    }
  }
  return FrameSearch(sample, JudgeBySpread).Run();
}

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
         (beside > 0 ? ", to " + LengthText(beside) + " and their scatter"
                     : "") +
         ", about which the model may be turned at will, expected some beside "
         "it; --point_positions_path adds those of points");
  }

  void PairUp() {
    const std::vector<ImageGeometry> geometries = ImageGeometries(model_);
    std::vector<Vector3d> own, in_model;
    for (size_t n = 0; n < positions_.size(); ++n) {
      const KnownPosition& position = positions_[n];
      const auto place = PlaceOf(model_, geometries, position);
      if (!place || !place->allFinite()) continue;
      FramePair pair;
      pair.index = n;
      pair.pose.center1 = position.region.centre;
      pair.pose.center2 = *place;
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

PositionFrame FindPositionFrame(const Model& model,
                                const std::vector<KnownPosition>& positions,
                                const std::string& source) {
  return FrameFinder(model, positions, source).Run();
}

}  // namespace krot::internal
