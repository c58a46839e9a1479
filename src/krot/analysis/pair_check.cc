#include "krot/database.h"

#include <algorithm>
#include <utility>

#include <Eigen/Geometry>

#include "krot/analysis/epipolar.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/model/rigs.h"

namespace krot {

using namespace internal;

namespace {

class PairChecker {
 public:
  PairChecker(const Model& model, const Database& database,
              const Context& context)
      : database_(database),
        context_(context),
        rays_(model, database),
        errors_px_(database.pairs.size()),
        parallax_px_(database.pairs.size()) {
    check_.pairs.resize(database.pairs.size());
    for (const Image& image : model.images) {
      CheckedImage& checked = check_.images.emplace_back();
      checked.image_id = image.id;
      checked.name = image.name;
    }
  }

  PairCheck Run() {
    Measure();
    const MatchNoise noise = EstimateMatchNoise(errors_px_, parallax_px_);
    check_.noise_px = noise.sigma_px;
    check_.tolerance_px = noise.tolerance_px;
    CountPairs();
    SearchBaselines();
    JudgePoses(rays_, database_, errors_px_, context_.num_threads, &check_);
    FindGroups();
    return std::move(check_);
  }

 private:
  std::vector<EpipolarMatch> MatchesOf(const VerifiedPair& pair) const {
    std::vector<EpipolarMatch> matches;
    matches.reserve(pair.matches.size());
    rays_.ForEach(pair, [&](const PixelRay& ray1, const PixelRay& ray2) {
      matches.emplace_back(rays_.World(ray1, pair.image1),
                           rays_.World(ray2, pair.image2));
    });
    return matches;
  }

  // The errors of each pair under the model's poses, ascending; none for pairs
  // with few matches or without a baseline.
  void Measure() {
    std::vector<int64_t> num_without_ray(database_.pairs.size(), 0);
    ForEachPair([&](int64_t p) {
      const VerifiedPair& pair = database_.pairs[p];
      CheckedPair& checked = check_.pairs[p];
      checked.image1 = pair.image1;
      checked.image2 = pair.image2;
      checked.median_error_px = kNaN;
      const ImageGeometry& first = rays_.geometries[pair.image1];
      const ImageGeometry& second = rays_.geometries[pair.image2];
      if (!first.has_pose || !second.has_pose) return;
      const std::vector<EpipolarMatch> matches = MatchesOf(pair);
      checked.num_matches = static_cast<int64_t>(matches.size());
      num_without_ray[p] =
          static_cast<int64_t>(pair.matches.size() - matches.size());
      const Eigen::Vector3d center1 = Center(first.cam_from_world);
      const Eigen::Vector3d center2 = Center(second.cam_from_world);
      // COLMAP's mapper uses no pair with fewer matches
      // (Mapper.min_num_matches). Centres in one place differ by rounding.
      if (checked.num_matches < 15 ||
          (center2 - center1).norm() <=
              1e-12 * (center1.norm() + center2.norm())) {
        return;
      }
      const Eigen::Vector3d baseline = (center2 - center1).normalized();
      std::vector<double>& errors = errors_px_[p];
      std::vector<double> parallaxes;
      for (const EpipolarMatch& match : matches) {
        errors.push_back(match.ErrorPx(baseline));
        parallaxes.push_back(match.ParallaxPx());
      }
      std::sort(errors.begin(), errors.end());
      parallax_px_[p] = Median(std::move(parallaxes));
      checked.median_error_px = errors[errors.size() / 2];
      checked.state = PairState::kUndecided;
    });
    for (const int64_t count : num_without_ray) check_.num_without_ray += count;
  }

  void CountPairs() {
    for (size_t p = 0; p < check_.pairs.size(); ++p) {
      CheckedPair& pair = check_.pairs[p];
      if (pair.state == PairState::kNotChecked) {
        ++check_.num_not_checked;
        continue;
      }
      const std::vector<double>& errors = errors_px_[p];
      pair.num_agreeing =
          std::upper_bound(errors.begin(), errors.end(), check_.tolerance_px) -
          errors.begin();
      for (const int32_t i : {pair.image1, pair.image2}) {
        CheckedImage& image = check_.images[i];
        if (2 * pair.num_agreeing >= pair.num_matches) {
          pair.state = PairState::kKept;
          ++image.num_kept;
          image.kept_matches += pair.num_matches;
        } else if (4 * pair.num_agreeing < pair.num_matches) {
          pair.state = PairState::kContradictory;
          ++image.num_contradictory;
          image.contradictory_matches += pair.num_matches;
        } else {
          ++image.num_undecided;
        }
      }
      if (pair.state == PairState::kKept) ++check_.num_kept;
      if (pair.state == PairState::kContradictory) ++check_.num_contradictory;
      if (pair.state == PairState::kUndecided) ++check_.num_undecided;
    }
  }

  void SearchBaselines() {
    ForEachPair([&](int64_t p) {
      CheckedPair& pair = check_.pairs[p];
      if (pair.state != PairState::kContradictory) return;
      BaselineSearch search =
          SearchBaseline(MatchesOf(database_.pairs[p]), check_.tolerance_px);
      pair.num_explained = search.num_explained;
      pair.most_explained = search.upper_bound;
      pair.best_baseline = search.baseline;
      pair.cells = std::move(search.cells);
    });
  }

  // What is left of contradictions between right images: either groups of
  // images contradict each other, or the matches are wrong.
  void FindGroups() {
    const auto num_images = static_cast<int32_t>(check_.images.size());
    DisjointSets joined(num_images);
    for (const CheckedPair& pair : check_.pairs) {
      if (pair.state == PairState::kKept && AreRight(pair)) {
        joined.Unite(pair.image1, pair.image2);
      }
    }
    std::vector<std::vector<int32_t>> groups(num_images);
    for (int32_t i = 0; i < num_images; ++i) {
      groups[joined.Find(i)].push_back(i);
    }
    std::vector<char> is_contradicted(num_images, 0);
    for (CheckedPair& pair : check_.pairs) {
      if (pair.state != PairState::kContradictory || !AreRight(pair)) continue;
      const int64_t a = joined.Find(pair.image1);
      const int64_t b = joined.Find(pair.image2);
      if (a == b || groups[a].size() < 2 || groups[b].size() < 2) {
        pair.has_wrong_matches = true;
      } else {
        is_contradicted[a] = is_contradicted[b] = 1;
      }
    }
    for (int32_t i = 0; i < num_images; ++i) {
      if (is_contradicted[i]) check_.groups.push_back(groups[i]);
    }
    std::stable_sort(
        check_.groups.begin(), check_.groups.end(),
        [](const auto& a, const auto& b) { return a.size() > b.size(); });
  }

  bool AreRight(const CheckedPair& pair) const {
    return !IsCalledWrong(pair.image1) && !IsCalledWrong(pair.image2);
  }

  bool IsCalledWrong(int32_t image) const {
    return std::binary_search(check_.cheapest.images.begin(),
                              check_.cheapest.images.end(), image);
  }

  template <typename Body>
  void ForEachPair(const Body& body) {
    ParallelFor(static_cast<int64_t>(check_.pairs.size()), 1,
                context_.num_threads,
                [&](int64_t begin, int64_t end, int /*worker*/) {
                  for (int64_t p = begin; p < end; ++p) body(p);
                });
  }

  const Database& database_;
  const Context& context_;
  const MatchRays rays_;
  std::vector<std::vector<double>> errors_px_;  // of each pair, ascending
  std::vector<double> parallax_px_;             // of each pair, the median
  PairCheck check_;
};

}  // namespace

bool PairCheck::IsAnythingWrong() const {
  return !groups.empty() ||
         std::any_of(images.begin(), images.end(),
                     [](const CheckedImage& image) { return image.is_wrong; });
}

PairCheck CheckPairs(const Model& model, const Database& database,
                     const Context& context) {
  return PairChecker(model, database, context).Run();
}

}  // namespace krot
