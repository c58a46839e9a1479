#include "krot/outliers/outlier_filter.h"

#include <set>

#include <gtest/gtest.h>

#include "tests/outliers/outlier_scenes.h"

namespace krot::internal {
namespace {

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

}  // namespace
}  // namespace krot::internal
