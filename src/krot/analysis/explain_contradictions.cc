#include "krot/analysis/epipolar.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

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
      best_.cost = bound;
      best_.images.clear();
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
