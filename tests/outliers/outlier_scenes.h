#pragma once

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/outliers/removal.h"
#include "krot/problem/subset.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {

// Small scenes with pinhole cameras, noise and outliers.
inline SceneOptions OutlierScene(uint64_t seed, double outlier_ratio,
                                 int num_points, double pixel_noise) {
  SceneOptions options = SceneOf(6, num_points, 4, pixel_noise, seed);
  options.camera_model_id = 1;
  options.outlier_ratio = outlier_ratio;
  return options;
}

inline SyntheticScene MakeOutlierScene(uint64_t seed, double outlier_ratio,
                                       int num_points = 60,
                                       double pixel_noise = 0.5) {
  return SynthesizeScene(
      OutlierScene(seed, outlier_ratio, num_points, pixel_noise));
}

// Disjoint conflicts among all observations, each with its proof.
inline std::vector<Conflict> DisjointConflicts(const Model& model,
                                               const BuiltProblem& built,
                                               const ErrorBound& bound) {
  Work work;
  std::vector<Conflict> conflicts;
  std::vector<std::vector<int64_t>> open = {
      NumbersUpTo<int64_t>(SignedSize(built.pixels))};
  while (!open.empty()) {
    const std::vector<int64_t> left =
        PruneUnconstrained(built.problem, open.back());
    open.pop_back();
    for (const auto& part : SplitIntoComponents(built.problem, left)) {
      std::optional<Conflict> found =
          FindConflict(model, built, bound, part, {}, &work);
      if (!found || !ProveConflict(model, built, bound, {}, &*found, &work)) {
        continue;
      }
      std::vector<int64_t>& rest = open.emplace_back();
      std::set_difference(part.begin(), part.end(), found->observations.begin(),
                          found->observations.end(), std::back_inserter(rest));
      conflicts.push_back(*std::move(found));
    }
  }
  return conflicts;
}

}  // namespace krot::internal
