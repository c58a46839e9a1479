#include "krot/model/derived_models.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

// Two images; point 10 has observations 0 of both, and 0 of the first twice;
// point 11 has observations 1 of both.
Model MakeModel() {
  Model model;
  model.cameras.push_back({1, 0, 100, 100, {100, 50, 50}});
  for (const ImageId id : {1u, 2u}) {
    Image image;
    image.id = id;
    image.camera_id = 1;
    image.name = std::to_string(id);
    image.points2D = {{10, 10, 10}, {20, 20, 11}};
    model.images.push_back(image);
  }
  model.track_elements = {{1, 0}, {2, 0}, {1, 0}, {1, 1}, {2, 1}};
  Point3D point;
  point.id = 10;
  point.track_end = 3;
  model.points3D.push_back(point);
  point.id = 11;
  point.track_begin = 3;
  point.track_end = 5;
  model.points3D.push_back(point);
  UseTrivialRigs(&model);
  return model;
}

TEST(RemoveObservations, TakesATrackOfOneWithIt) {
  const RemovedObservations removed =
      RemoveObservations(MakeModel(), {0, 0, 0, 1, 0});
  ValidateModel(removed.model);
  ASSERT_EQ(removed.model.points3D.size(), 1u);
  EXPECT_EQ(removed.num_points, 1);
  EXPECT_EQ(removed.num_left_alone, 1);
  EXPECT_THAT(removed.element_of, testing::ElementsAre(0, 1, 2));
  for (const Image& image : removed.model.images) {
    EXPECT_EQ(image.points2D[1].point3D_id, kInvalidPoint3DId);
    EXPECT_EQ(image.points2D[0].point3D_id, 10u);
  }
}

TEST(RemoveObservations, KeepsA2DPointThatTheTrackHoldsASecondTime) {
  const RemovedObservations removed =
      RemoveObservations(MakeModel(), {1, 0, 0, 0, 0});
  ValidateModel(removed.model);
  EXPECT_EQ(removed.model.images[0].points2D[0].point3D_id, 10u);
  EXPECT_THAT(removed.element_of, testing::ElementsAre(1, 2, 3, 4));
}

TEST(RemoveObservations, OfNothingIsTheModel) {
  const RemovedObservations removed =
      RemoveObservations(MakeModel(), {0, 0, 0, 0, 0});
  EXPECT_EQ(removed.model.track_elements.size(), 5u);
  EXPECT_EQ(removed.num_points, 0);
  EXPECT_THROW(RemoveObservations(MakeModel(), {0}), std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
