#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "krot/base/checkpoint.h"
#include "krot/model/derived_models.h"
#include "krot/model/formats.h"
#include "krot/pipeline/solve_model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"
#include "tests/testing/thread_ranks.h"

// A solve by ranks that are threads of this process, and what its result is
// compared by.

namespace krot::internal {

// Small, with enough noise for sweeps and the joint solver.
inline SceneOptions SceneToShare() {
  SceneOptions options = SceneOf(12, 400, 4, 0.5);
  options.start_translation_noise = 0.005;
  options.start_point_noise = 0.005;
  return options;
}

// Puts the shares' points into their places in the whole.
inline void PutPoints(const Model& whole, int rank, int count,
                      const Model& share, Model* joined) {
  const std::vector<int32_t> points = CutPoints(whole, count)[rank];
  for (size_t n = 0; n < points.size(); ++n) {
    joined->points3D[points[n]].xyz = share.points3D[n].xyz;
    joined->points3D[points[n]].error = share.points3D[n].error;
  }
}

// Of all ranks.
struct Solved {
  Model model;
  SolveSummary summary;  // of the first rank
};

inline Solved SolveByRanks(const Model& whole, const SolveModelOptions& options,
                           int count, Checkpoint* checkpoint = nullptr) {
  Solved solved;
  std::vector<Model> shares(count);
  ThreadRanks::Run(count, [&](Ranks* ranks) {
    const ModelShare share =
        TakeShare(whole, CutPoints(whole, count)[ranks->rank()]);
    Context context{1};
    context.ranks = ranks;
    SolveModelOptions own = options;
    Checkpoint none;
    if (checkpoint != nullptr) {
      own.checkpoint = ranks->IsFirst() ? checkpoint : &none;
    }
    SolveModelResult result = SolveModel(share.model, own, context);
    shares[ranks->rank()] = std::move(result.model);
    if (ranks->IsFirst()) solved.summary = std::move(result.summary);
  });
  solved.model = whole;
  solved.model.frames = shares[0].frames;
  for (size_t n = 0; n < whole.images.size(); ++n) {
    solved.model.images[n].cam_from_world = shares[0].images[n].cam_from_world;
  }
  for (int r = 0; r < count; ++r) {
    PutPoints(whole, r, count, shares[r], &solved.model);
  }
  return solved;
}

inline void ExpectSameBits(const Solved& a, const Solved& b) {
  EXPECT_EQ(FormatImagesBinary(a.model), FormatImagesBinary(b.model));
  EXPECT_EQ(FormatFramesBinary(a.model), FormatFramesBinary(b.model));
  EXPECT_EQ(FormatPoints3DBinary(a.model), FormatPoints3DBinary(b.model));
  EXPECT_EQ(a.summary.termination, b.summary.termination);
  EXPECT_EQ(a.summary.cost_final, b.summary.cost_final);
  EXPECT_EQ(a.summary.lower_bound, b.summary.lower_bound);
  EXPECT_EQ(a.summary.rounds.size(), b.summary.rounds.size());
  EXPECT_EQ(a.summary.sweeps.size(), b.summary.sweeps.size());
  EXPECT_EQ(a.summary.iterations.size(), b.summary.iterations.size());
  EXPECT_EQ(a.summary.num_observations, b.summary.num_observations);
  EXPECT_EQ(a.summary.support.size(), b.summary.support.size());
}

}  // namespace krot::internal
