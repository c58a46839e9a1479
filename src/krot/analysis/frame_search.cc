#include "krot/analysis/frame_search.h"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <random>
#include <utility>

#include "krot/base/numbers.h"

namespace krot::internal {

std::vector<PosePair> PosesOf(const std::vector<FramePair>& pairs) {
  std::vector<PosePair> poses;
  for (const FramePair& pair : pairs) poses.push_back(pair.pose);
  return poses;
}

Eigen::Vector3d OffsetAt(const Similarity& own_from_model,
                         const FramePair& pair) {
  return own_from_model * pair.pose.center2 - pair.pose.center1;
}

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

namespace {

constexpr int64_t kMostTriples = 50'000;
constexpr size_t kMostScored = 300;

// How well a similarity fits the positions; a lower score is better.
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

  // Fits the positions that agree with the best similarity, within the
  // tolerance or twice that, as three places say less than all of them.
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

// At most kMostScored pairs, always the same.
std::vector<FramePair> Sample(std::vector<FramePair> pairs) {
  if (pairs.size() <= kMostScored) return pairs;
  std::mt19937_64 generator(2);
  for (size_t n = 0; n < kMostScored; ++n) {
    std::swap(pairs[n], pairs[n + generator() % (pairs.size() - n)]);
  }
  pairs.resize(kMostScored);
  return pairs;
}

}  // namespace

double SpreadTolerance(const std::vector<double>& misfits) {
  return JudgeBySpread(misfits).tolerance;
}

std::optional<Similarity> SearchFrame(const std::vector<FramePair>& pairs,
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

}  // namespace krot::internal
