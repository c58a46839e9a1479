#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "krot/database.h"

namespace krot::internal {

// A pair that contradicts the poses, by the matches that are lost if these are
// called wrong.
struct ContradictoryPair {
  int32_t image1 = 0;
  int32_t image2 = 0;  // another image
  int64_t num_matches = 0;
};

struct Explanations {
  Explanation cheapest;
  // The cheapest of those that call one of its images right, or an image wrong
  // that is in a contradiction between two right ones; none if there is none.
  std::optional<Explanation> runner_up;
  bool is_proved = true;
};

// The set of images that, called wrong, costs least: an image costs
// `image_costs[i]` matches, a contradiction between two images that are not
// called wrong its own. Image by image it is settled whether calling it
// wrong pays whatever the others are; what is left is branched on, `max_nodes`
// times at most for each explanation.
Explanations ExplainContradictions(
    const std::vector<int64_t>& image_costs,
    const std::vector<ContradictoryPair>& contradictions,
    int64_t max_nodes = 100000);

}  // namespace krot::internal
