// What ranks that share the points make of a model has the bits of what one
// process makes of it.

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/convert/certificate_file.h"
#include "krot/joint/joint.h"
#include "krot/linear/blocks.h"
#include "krot/linear/ordered_sums.h"
#include "krot/model/derived_models.h"
#include "krot/pipeline/solve_model.h"
#include "krot/problem/cost.h"
#include "krot/synthetic/scene.h"
#include "tests/pipeline/solve_by_ranks.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/thread_ranks.h"

namespace krot::internal {
namespace {

class SolveByRanksTest : public ::testing::TestWithParam<int> {
 protected:
  static void Compare(const SceneOptions& scene,
                      const SolveModelOptions& options) {
    const Model whole = SynthesizeScene(scene).model;
    SolveModelResult alone = SolveModel(whole, options, Context{1});
    ExpectSameBits(SolveByRanks(whole, options, GetParam()),
                   {std::move(alone.model), std::move(alone.summary)});
  }
};

TEST_P(SolveByRanksTest, HasTheBitsOfOneProcess) {
  Compare(SceneToShare(), {});
}

TEST_P(SolveByRanksTest, HasTheBitsOfOneProcessWhereRowsAreTakenAnew) {
  SceneOptions scene = SceneToShare();
  scene.camera_model_id = 4;  // OPENCV
  Compare(scene, {});
}

TEST_P(SolveByRanksTest, HasTheBitsOfOneProcessWithBaselines) {
  SceneOptions scene = SceneToShare();
  scene.sensors_per_rig = 2;
  Compare(scene, {});
}

TEST_P(SolveByRanksTest, HasTheBitsOfOneProcessBySweepsAlone) {
  SolveModelOptions options;
  options.method = SolveMethod::kResInt;
  Compare(SceneToShare(), options);
}

TEST_P(SolveByRanksTest, HasTheBitsOfOneProcessInTheLargestNorm) {
  SolveModelOptions options;
  options.norm = Norm::LInf();
  Compare(SceneToShare(), options);
}

TEST_P(SolveByRanksTest, HasTheBitsOfOneProcessWhereWorkingSetsGrow) {
  SceneOptions scene = SceneToShare();
  scene.layout = SceneLayout::kStreet;
  scene.num_frames = 40;
  scene.num_points = 4000;
  Compare(scene, {});
}

INSTANTIATE_TEST_SUITE_P(OfSoMany, SolveByRanksTest,
                         ::testing::Values(1, 2, 3, 4, 7));

TEST(SolveByRanks, RefusesWhatIsForOneProcess) {
  const Model whole = SynthesizeScene(SceneToShare()).model;
  SolveModelOptions options;
  options.init = SolveInit::kFeasible;
  EXPECT_EQ(MessageOf<RanksError>([&] { SolveByRanks(whole, options, 2); }),
            "a start from nothing is for one process: use krot solver");
}

int64_t NumObservations(const Model& model,
                        const std::vector<int32_t>& points) {
  int64_t count = 0;
  for (const int32_t k : points) {
    const Point3D& point = model.points3D[k];
    count += static_cast<int64_t>(point.track_end - point.track_begin);
  }
  return count;
}

TEST(CutPoints, GivesEveryPointToOneRankInTheOrderOfIds) {
  const Model whole = SynthesizeScene(SceneToShare()).model;
  for (const int count : {1, 2, 3, 7}) {
    std::vector<int32_t> all;
    Point3DId last = 0;
    for (const std::vector<int32_t>& points : CutPoints(whole, count)) {
      EXPECT_TRUE(std::is_sorted(points.begin(), points.end()));
      Point3DId largest = last;
      for (const int32_t k : points) {
        EXPECT_TRUE(last == 0 || whole.points3D[k].id > last);
        largest = std::max(largest, whole.points3D[k].id);
        all.push_back(k);
      }
      last = largest;
    }
    std::sort(all.begin(), all.end());
    EXPECT_EQ(std::unique(all.begin(), all.end()), all.end());
    EXPECT_EQ(all.size(), whole.points3D.size());
  }
}

TEST(CutPoints, GivesEveryRankAsManyObservations) {
  const Model whole = SynthesizeScene(SceneToShare()).model;
  for (const int count : {1, 2, 4}) {
    for (const std::vector<int32_t>& points : CutPoints(whole, count)) {
      EXPECT_NEAR(static_cast<double>(NumObservations(whole, points)),
                  static_cast<double>(whole.track_elements.size()) / count, 20);
    }
  }
}

TEST(TakeShare, KeepsEveryObservationOfItsPoints) {
  const Model whole = SynthesizeScene(SceneToShare()).model;
  const std::vector<int32_t> points = CutPoints(whole, 2)[1];
  const ModelShare share = TakeShare(whole, points);
  ASSERT_EQ(share.model.points3D.size(), points.size());
  for (size_t n = 0; n < points.size(); ++n) {
    const Point3D& own = share.model.points3D[n];
    const Point3D& in_whole = whole.points3D[points[n]];
    ASSERT_EQ(own.track_end - own.track_begin,
              in_whole.track_end - in_whole.track_begin);
    for (uint64_t e = 0; e < own.track_end - own.track_begin; ++e) {
      const TrackElement& a = share.model.track_elements[own.track_begin + e];
      const TrackElement& b = whole.track_elements[in_whole.track_begin + e];
      ASSERT_EQ(a.image_id, b.image_id);
      size_t image = 0;
      while (whole.images[image].id != a.image_id) ++image;
      EXPECT_EQ(share.model.images[image].points2D[a.point2D_idx].x,
                whole.images[image].points2D[b.point2D_idx].x);
      EXPECT_EQ(share.point2D_of[image][a.point2D_idx], b.point2D_idx);
    }
  }
}

TEST(ObservationLoop, SumsOverRanksAsOverAll) {
  constexpr int64_t kCounts[] = {5000, 0, 17, 9000, 4096, 123};
  const auto term = [](int64_t i) { return 1.0 / static_cast<double>(i + 1); };
  int64_t total = 0;
  for (const int64_t count : kCounts) total += count;
  const double alone = ObservationLoop(total, 1).Sum(term);
  ThreadRanks::Run(6, [&](Ranks* ranks) {
    Context context{1};
    context.ranks = ranks;
    const int64_t first = ranks->SumBefore(kCounts[ranks->rank()]);
    const ObservationLoop loop(kCounts[ranks->rank()], context);
    EXPECT_EQ(loop.Sum([&](int64_t i) { return term(first + i); }), alone);
  });
}

TEST(Ranks, GatherInTheirOrderAndHandOnInTurn) {
  ThreadRanks::Run(4, [](Ranks* ranks) {
    const std::vector<int> own(static_cast<size_t>(ranks->rank()),
                               ranks->rank());
    EXPECT_THAT(ranks->Gather(own), ::testing::ElementsAre(1, 2, 2, 3, 3, 3));
    EXPECT_EQ(ranks->GatherOnFirst(own).size(), ranks->IsFirst() ? 6u : 0u);
    std::vector<char> letters;
    ranks->InTurn(
        [&](std::vector<char>* all) {
          all->push_back(static_cast<char>('a' + ranks->rank()));
        },
        &letters);
    EXPECT_THAT(letters, ::testing::ElementsAre('a', 'b', 'c', 'd'));
    EXPECT_EQ(ranks->SumBefore(10), 10 * ranks->rank());
  });
}

// Which frames see each point.
BlockStructure StructureOf(const std::vector<std::vector<int32_t>>& tracks) {
  BlockStructure structure;
  structure.point_begin = {0};
  for (const std::vector<int32_t>& track : tracks) {
    structure.frame_of.insert(structure.frame_of.end(), track.begin(),
                              track.end());
    structure.point_begin.push_back(
        static_cast<int64_t>(structure.frame_of.size()));
  }
  structure.frame_is_fixed = {0, 0, 1, 0, 0};
  return structure;
}

TEST(BlockPattern, OfSharesIsThatOfTheWhole) {
  const BlockPattern whole =
      PairsThatSharePoints(StructureOf({{0, 1, 2}, {3, 0}, {4, 1}, {1, 0, 0}}));
  const std::vector<BlockStructure> shares = {StructureOf({{0, 1, 2}, {3, 0}}),
                                              StructureOf({}),
                                              StructureOf({{4, 1}, {1, 0, 0}})};
  ThreadRanks::Run(3, [&](Ranks* ranks) {
    EXPECT_EQ(PairsThatSharePoints(shares[ranks->rank()], ranks), whole);
  });
}

}  // namespace
}  // namespace krot::internal
