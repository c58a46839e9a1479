#include "krot/convert/build_problem.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "krot/model.h"
#include "tests/convert/lens_model.h"

namespace krot::internal {
namespace {

// Point 0 is seen by image 0 alone, so that it takes no part.
Model ModelWithAShortTrack() {
  Model model = MakeLensModel({});
  const uint64_t num_images = model.images.size();
  for (uint64_t e = 1; e < num_images; ++e) {
    model.images[e].points2D[0].point3D_id = kInvalidPoint3DId;
  }
  model.track_elements.erase(model.track_elements.begin() + 1,
                             model.track_elements.begin() + num_images);
  model.points3D[0].track_end = 1;
  for (size_t k = 1; k < model.points3D.size(); ++k) {
    model.points3D[k].track_begin -= num_images - 1;
    model.points3D[k].track_end -= num_images - 1;
  }
  return model;
}

TEST(CarryLeftOutPoints, KeepsTheErrorOfAPointWhoseOnlyImageHasMoved) {
  const Model before = ModelWithAShortTrack();
  const BuiltProblem built = BuildProblem(before, {});
  ASSERT_EQ(built.problem.num_points,
            static_cast<int>(before.points3D.size()) - 1);
  const std::vector<double> errors_px = PixelErrors(before);
  Model moved = before;
  moved.frames[0].rig_from_world.translation += Eigen::Vector3d(0.3, 0.1, 0);
  ASSERT_GT(PixelErrors(moved)[0], errors_px[0] + 10);

  Model after = moved;
  CarryLeftOutPoints(before, errors_px, Norm::L2(), built, {},
                     /*level=*/1e-3, &after);
  EXPECT_NEAR(PixelErrors(after)[0], errors_px[0], 1e-9);
  for (size_t k = 1; k < after.points3D.size(); ++k) {
    EXPECT_EQ(after.points3D[k].xyz, before.points3D[k].xyz);
  }
}

TEST(CarryLeftOutPoints, LeavesAPointWhoseErrorIsBelowTheLevel) {
  const Model before = ModelWithAShortTrack();
  Model after = before;
  after.images[0].cam_from_world.translation += Eigen::Vector3d(0.3, 0.1, 0);
  CarryLeftOutPoints(before, PixelErrors(before), Norm::L2(),
                     BuildProblem(before, {}), {},
                     /*level=*/1e4, &after);
  EXPECT_EQ(after.points3D[0].xyz, before.points3D[0].xyz);
}

}  // namespace
}  // namespace krot::internal
