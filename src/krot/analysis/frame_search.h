#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/analysis/model_comparison.h"
#include "krot/base/numbers.h"
#include "krot/geometry.h"

namespace krot::internal {

// The robust similarity search behind FindPositionFrame (model_input.h).

// In units of the median distance: one of a thousand Gaussian errors in three
// dimensions is farther off.
inline constexpr double kFarByMedian = 2.6;
inline constexpr int kMaxRefits = 20;

// A known position, and where the model places it. `pose.center1` is the
// position, relative to the median of all positions; `pose.center2` is the
// model's place, relative to the median of all places.
struct FramePair {
  size_t index = 0;
  PosePair pose;
  Eigen::Matrix3d unit_from_own = Eigen::Matrix3d::Identity();
};

// The similarity that fits these pairs best; none if it is not determined.
inline std::optional<Similarity> FitTo(const std::vector<FramePair>& pairs) {
  std::vector<PosePair> poses;
  for (const FramePair& pair : pairs) poses.push_back(pair.pose);
  const std::optional<Similarity> fit = AlignCenters(poses);
  return fit && fit->scale > 0 ? fit : std::nullopt;
}

// The model's place, taken to the positions' frame, minus the position.
inline Eigen::Vector3d OffsetAt(const Similarity& own_from_model,
                                const FramePair& pair) {
  return own_from_model * pair.pose.center2 - pair.pose.center1;
}

// Distances in radii, or in the positions' unit where radii are unknown.
inline std::vector<double> MisfitsOf(const std::vector<FramePair>& pairs,
                                     const Similarity& own_from_model) {
  std::vector<double> misfits;
  for (const FramePair& pair : pairs) {
    misfits.push_back(
        (pair.unit_from_own * OffsetAt(own_from_model, pair)).norm());
  }
  return misfits;
}

inline std::vector<FramePair> Within(const std::vector<FramePair>& pairs,
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

inline Judgement JudgeByRadii(const std::vector<double>& misfits) {
  Judgement judgement{0, 1};
  for (const double misfit : misfits) {
    judgement.score += std::min(misfit * misfit, 1.0);
  }
  return judgement;
}

// The score is the misfit that a majority does not exceed: at least four where
// there are as many, since any three places nearly fit.
inline Judgement JudgeBySpread(std::vector<double> misfits) {
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
inline std::vector<FramePair> Sample(std::vector<FramePair> pairs) {
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
inline std::optional<Similarity> SearchFrame(
    const std::vector<FramePair>& pairs, bool has_radii) {
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

}  // namespace krot::internal
