#include "krot/outliers/outlier_filter.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "krot/convert/reprojection.h"
#include "krot/model/rigs.h"
#include "krot/outliers/removal.h"
#include "tests/outliers/outlier_scenes.h"

namespace krot::internal {
namespace {

constexpr size_t kTurnedFrame = 2;
constexpr double kSuspectBound = 2;
constexpr double kRadians = 3.14159265358979323846 / 180;

// A scene with half a pixel of noise in which one camera is turned where it
// stands.
Model SceneWithATurnedCamera(double angle_deg, const Eigen::Vector3d& axis,
                             double outlier_ratio = 0) {
  Model model = MakeOutlierScene(11, outlier_ratio, 150).model;
  const RigidTransform turn{
      Eigen::AngleAxisd(angle_deg * kRadians, axis.normalized())
          .toRotationMatrix(),
      Eigen::Vector3d::Zero()};
  Pose& pose = model.frames[kTurnedFrame].rig_from_world;
  pose = ToPose(turn * pose.Transform());
  for (size_t n = 0; n < model.images.size(); ++n) {
    const ImageGeometry geometry = ImageGeometries(model)[n];
    model.images[n].cam_from_world = ToPose(geometry.cam_from_world);
  }
  return model;
}

ImageId TurnedImage(const Model& model) {
  return static_cast<ImageId>(model.frames[kTurnedFrame].data[0].data_id);
}

OutlierFilterSummary Filter(const Model& model) {
  OutlierFilterOptions options;
  options.max_error = kSuspectBound;
  return FilterOutliers(model, options, {}).summary;
}

TEST(RotationSuspect, IsTheImageThatIsTurnedAndItsTurnIsRecovered) {
  const Eigen::Vector3d axes[] = {{1, 0, 0}, {0, 1, 0}, {1, -2, 3}};
  for (const Eigen::Vector3d& axis : axes) {
    const Model model = SceneWithATurnedCamera(1, axis);
    const OutlierFilterSummary summary = Filter(model);
    ASSERT_TRUE(summary.rotation_suspect);
    const RotationSuspect& suspect = *summary.rotation_suspect;
    EXPECT_EQ(suspect.image_id, TurnedImage(model));
    EXPECT_EQ(suspect.num_conflicts, summary.num_proved);
    // The turn back.
    EXPECT_NEAR(suspect.angle_deg, 1, 0.1);
    EXPECT_LT(suspect.axis_in_cam.dot(axis.normalized()), -0.98);
    EXPECT_GT(suspect.num_above, suspect.num_observations / 4);
    EXPECT_LT(suspect.num_above_turned, suspect.num_above / 4);
    EXPECT_GT(suspect.lower_bound_with, kSuspectBound);
    EXPECT_LT(suspect.max_error_without, kSuspectBound);
  }
}

TEST(RotationSuspect, IsFoundAmongOutliersOfOtherImages) {
  const Model model = SceneWithATurnedCamera(1, {0, 1, 0}, 0.01);
  const OutlierFilterSummary summary = Filter(model);
  ASSERT_TRUE(summary.rotation_suspect);
  EXPECT_EQ(summary.rotation_suspect->image_id, TurnedImage(model));
  EXPECT_NEAR(summary.rotation_suspect->angle_deg, 1, 0.1);
}

TEST(RotationSuspect, WithoutTheImageAllIsWithinAsABruteSolveSays) {
  Model model = SceneWithATurnedCamera(1, {0, 1, 0});
  const RotationSuspect suspect = *Filter(model).rotation_suspect;
  SolveModelOptions options;
  options.finish.finish = Finish::kNone;
  const SolveModelResult with = SolveModel(model, options);
  EXPECT_NEAR(suspect.lower_bound_with, with.summary.cost_final,
              2e-3 * with.summary.cost_final);
}

TEST(RotationSuspect, IsNoneWhereOutliersAreAllOver) {
  const SyntheticScene scene = MakeOutlierScene(12, 0.02, 150);
  EXPECT_FALSE(Filter(scene.model).rotation_suspect);
}

TEST(ColorSuspects, TellsTracksThatLostObservationsFromThoseInConflictAlone) {
  Model model = MakeOutlierScene(3, 0.05).model;
  OutlierFilterOptions options;
  options.max_error = 2;
  const OutlierFilterSummary summary =
      FilterOutliers(model, options, {}).summary;
  std::set<Point3DId> removed, in_conflict;
  for (const RemovedObservation& o : summary.removed) {
    removed.insert(o.point3D_id);
  }
  for (const auto& conflict : summary.conflicts->conflicts) {
    for (const auto& o : conflict.observations) {
      if (removed.count(o.point3D_id) == 0) in_conflict.insert(o.point3D_id);
    }
  }
  ASSERT_FALSE(removed.empty());
  ASSERT_FALSE(in_conflict.empty());
  ColorSuspects(summary, &model);
  for (const Point3D& point : model.points3D) {
    EXPECT_EQ(point.color == kRemovedColor, removed.count(point.id) > 0);
    EXPECT_EQ(point.color == kConflictColor, in_conflict.count(point.id) > 0);
    EXPECT_EQ(point.color == kUnsuspectedColor,
              removed.count(point.id) + in_conflict.count(point.id) == 0);
  }
}

constexpr double kTwoViewBound = 2;

struct Charged {
  explicit Charged(uint64_t seed)
      : scene(MakeOutlierScene(seed, 0.05)),
        built(BuildProblem(scene.model, {})),
        removal(
            FindRemoval(scene.model, built, {Norm::L2(), kTwoViewBound}, {})),
        is_free(built.pixels.size(), 1) {
    for (const int64_t i : removal.observations) is_free[i] = 0;
  }

  int32_t ViewOf(int64_t i) const { return built.problem.observations[i].view; }

  const SyntheticScene scene;
  const BuiltProblem built;
  const Removal removal;
  std::vector<char> is_free;
};

TEST(TwoViewConflicts, CandidatesDoNotGoTogetherByTheSolver) {
  int num_candidates = 0;
  for (const uint64_t seed : {1u, 2u, 3u}) {
    const Charged c(seed);
    const TwoViewConflicts conflicts(c.built.problem, c.removal.estimate,
                                     kTwoViewBound);
    for (const int64_t i : c.removal.observations) {
      for (const std::vector<int64_t>& set :
           conflicts.Candidates(i, c.is_free)) {
        ++num_candidates;
        Work work;
        EXPECT_TRUE(FindConflict(c.scene.model, c.built,
                                 {Norm::L2(), kTwoViewBound}, set, {}, &work))
            << "observation " << i << ", seed " << seed;
      }
    }
  }
  EXPECT_GT(num_candidates, 50);
}

TEST(TwoViewConflicts, CandidatesAreOfTwoViewsAndOfWhatMayBeUsed) {
  Charged c(4);
  for (size_t i = 0; i < c.is_free.size(); i += 3) c.is_free[i] = 0;
  const TwoViewConflicts conflicts(c.built.problem, c.removal.estimate,
                                   kTwoViewBound);
  size_t num_candidates = 0;
  for (const int64_t i : c.removal.observations) {
    for (const std::vector<int64_t>& set : conflicts.Candidates(i, c.is_free)) {
      ++num_candidates;
      EXPECT_TRUE(std::is_sorted(set.begin(), set.end()));
      std::set<int32_t> views;
      for (const int64_t j : set) {
        views.insert(c.ViewOf(j));
        EXPECT_TRUE(j == i || c.is_free[j]);
      }
      EXPECT_EQ(views.size(), 2u);
      EXPECT_TRUE(std::binary_search(set.begin(), set.end(), i));
    }
  }
  EXPECT_GT(num_candidates, 0u);
}

TEST(TwoViewConflicts, HasNoCandidateForWhatIsWithinTheBound) {
  const Charged c(5);
  const TwoViewConflicts conflicts(c.built.problem, c.removal.estimate,
                                   kTwoViewBound);
  for (int64_t i = 0; i < static_cast<int64_t>(c.is_free.size()); ++i) {
    if (!c.is_free[i]) continue;
    EXPECT_TRUE(conflicts.Candidates(i, c.is_free).empty());
  }
}

}  // namespace
}  // namespace krot::internal
