#include "krot/database.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "krot/analysis/epipolar.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

enum class Choice : uint8_t { kOpen, kWrong, kRight };

struct Edge {
  int32_t neighbour;
  int64_t num_matches;
};

class CoverSearch {
 public:
  CoverSearch(const std::vector<int64_t>& image_costs,
              const std::vector<ContradictoryPair>& contradictions)
      : costs_(image_costs), edges_(image_costs.size()) {
    for (const ContradictoryPair& pair : contradictions) {
      edges_[pair.image1].push_back({pair.image2, pair.num_matches});
      edges_[pair.image2].push_back({pair.image1, pair.num_matches});
    }
  }

  // From now on, so many pairs may be visited.
  void Allow(int64_t visits) { visits_left_ = visits; }
  bool IsAtEnd() const { return visits_left_ < 0; }

  // The cheapest explanation; if `forced`, with this choice for this image.
  Explanation Run(std::optional<std::pair<int32_t, Choice>> forced) {
    std::vector<Choice> choices(costs_.size(), Choice::kOpen);
    for (size_t i = 0; i < edges_.size(); ++i) {
      if (edges_[i].empty()) choices[i] = Choice::kRight;
    }
    if (forced) choices[forced->first] = forced->second;
    best_ = {{}, std::numeric_limits<int64_t>::max()};
    Branch(std::move(choices));
    return best_;
  }

  bool is_proved() const { return is_proved_; }
  const std::vector<Edge>& edges(int32_t image) const { return edges_[image]; }

 private:
  // The matches of an image's contradictions with images of this choice.
  int64_t Against(size_t image, Choice choice,
                  const std::vector<Choice>& choices) {
    visits_left_ -= static_cast<int64_t>(edges_[image].size());
    int64_t matches = 0;
    for (const Edge& edge : edges_[image]) {
      if (choices[edge.neighbour] == choice) matches += edge.num_matches;
    }
    return matches;
  }

  // Settles the images for which one choice pays whatever the others are.
  void Settle(std::vector<Choice>* choices) {
    for (bool has_changed = true; has_changed;) {
      has_changed = false;
      for (size_t i = 0; i < choices->size(); ++i) {
        Choice& choice = (*choices)[i];
        if (choice != Choice::kOpen) continue;
        const int64_t sure = Against(i, Choice::kRight, *choices);
        if (costs_[i] < sure) {
          choice = Choice::kWrong;
        } else if (costs_[i] >= sure + Against(i, Choice::kOpen, *choices)) {
          choice = Choice::kRight;
        }
        has_changed = has_changed || choice != Choice::kOpen;
      }
    }
  }

  // A lower bound for the cost of the choices. If images are open, *open is the
  // one with the most matches against other open ones.
  int64_t LowerBound(const std::vector<Choice>& choices,
                     std::optional<size_t>* open) {
    int64_t bound = 0, twice_between_right = 0, most = -1;
    for (size_t i = 0; i < choices.size(); ++i) {
      const int64_t sure = Against(i, Choice::kRight, choices);
      if (choices[i] == Choice::kWrong) bound += costs_[i];
      if (choices[i] == Choice::kRight) twice_between_right += sure;
      if (choices[i] != Choice::kOpen) continue;
      bound += std::min(costs_[i], sure);
      const int64_t undecided = Against(i, Choice::kOpen, choices);
      if (undecided > most) {
        most = undecided;
        *open = i;
      }
    }
    return bound + twice_between_right / 2;
  }

  void Branch(std::vector<Choice> choices) {
    if (IsAtEnd()) {
      is_proved_ = false;
      // What is still open is called right, which is an explanation, too.
      if (best_.cost < std::numeric_limits<int64_t>::max()) return;
      std::replace(choices.begin(), choices.end(), Choice::kOpen,
                   Choice::kRight);
    }
    Settle(&choices);
    std::optional<size_t> open;
    const int64_t bound = LowerBound(choices, &open);
    if (bound >= best_.cost) return;
    if (!open) {
      best_ = {{}, bound};
      for (size_t i = 0; i < choices.size(); ++i) {
        if (choices[i] == Choice::kWrong) {
          best_.images.push_back(static_cast<int32_t>(i));
        }
      }
      return;
    }
    for (const Choice choice : {Choice::kRight, Choice::kWrong}) {
      choices[*open] = choice;
      Branch(choices);
    }
  }

  const std::vector<int64_t>& costs_;
  std::vector<std::vector<Edge>> edges_;
  int64_t visits_left_ = 0;
  bool is_proved_ = true;
  Explanation best_;
};

// The cost that both have: images that both call wrong, and pairs of which
// neither calls an image wrong.
int64_t CommonCost(const Explanation& a, const Explanation& b,
                   const std::vector<int64_t>& image_costs,
                   const std::vector<ContradictoryPair>& contradictions) {
  std::vector<int32_t> both, any;
  std::set_intersection(a.images.begin(), a.images.end(), b.images.begin(),
                        b.images.end(), std::back_inserter(both));
  std::set_union(a.images.begin(), a.images.end(), b.images.begin(),
                 b.images.end(), std::back_inserter(any));
  int64_t cost = 0;
  for (const int32_t i : both) cost += image_costs[i];
  const auto is_any = [&](int32_t image) {
    return std::binary_search(any.begin(), any.end(), image);
  };
  for (const ContradictoryPair& pair : contradictions) {
    if (!is_any(pair.image1) && !is_any(pair.image2)) cost += pair.num_matches;
  }
  return cost;
}

}  // namespace

Explanations ExplainContradictions(
    const std::vector<int64_t>& image_costs,
    const std::vector<ContradictoryPair>& contradictions, int64_t max_visits) {
  CoverSearch search(image_costs, contradictions);
  Explanations explanations;
  search.Allow(max_visits);
  explanations.cheapest = search.Run(std::nullopt);
  const std::vector<int32_t>& wrong = explanations.cheapest.images;
  const auto is_wrong = [&](int32_t image) {
    return std::binary_search(wrong.begin(), wrong.end(), image);
  };
  search.Allow(max_visits);
  // Another explanation calls one of the wrong images right, or one image of
  // a pair wrong whose matches are called wrong now.
  for (int32_t i = 0; i < static_cast<int32_t>(image_costs.size()); ++i) {
    const auto& edges = search.edges(i);
    const bool counts =
        is_wrong(i) || std::any_of(edges.begin(), edges.end(), [&](Edge edge) {
          return !is_wrong(edge.neighbour);
        });
    if (!counts) continue;
    if (search.IsAtEnd()) break;
    Explanation other = search.Run(
        std::make_pair(i, is_wrong(i) ? Choice::kRight : Choice::kWrong));
    const int64_t common =
        CommonCost(explanations.cheapest, other, image_costs, contradictions);
    if (10 * (other.cost - common) >
        11 * (explanations.cheapest.cost - common)) {
      continue;
    }
    if (!explanations.runner_up || other.cost < explanations.runner_up->cost) {
      explanations.runner_up = std::move(other);
    }
  }
  explanations.is_proved = search.is_proved() && !search.IsAtEnd();
  return explanations;
}

}  // namespace krot::internal

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
    for (const auto& match : pair.matches) {
      const auto condition = rays_.ConditionOf(pair, match);
      if (condition) matches.push_back(*condition);
    }
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
      const bool is_kept = 2 * pair.num_agreeing >= pair.num_matches;
      const bool is_contradictory = 4 * pair.num_agreeing < pair.num_matches;
      const bool is_undecided = !is_kept && !is_contradictory;
      pair.state = is_kept            ? PairState::kKept
                   : is_contradictory ? PairState::kContradictory
                                      : PairState::kUndecided;
      check_.num_kept += is_kept;
      check_.num_contradictory += is_contradictory;
      check_.num_undecided += is_undecided;
      for (const int32_t i : {pair.image1, pair.image2}) {
        CheckedImage& image = check_.images[i];
        image.num_kept += is_kept;
        image.num_contradictory += is_contradictory;
        image.num_undecided += is_undecided;
        if (is_kept) image.kept_matches += pair.num_matches;
        if (is_contradictory) image.contradictory_matches += pair.num_matches;
      }
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
    SortLargestFirst(&check_.groups, &std::vector<int32_t>::size);
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
    ParallelForEach(static_cast<int64_t>(check_.pairs.size()),
                    context_.num_threads, body, /*chunk_size=*/1);
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
