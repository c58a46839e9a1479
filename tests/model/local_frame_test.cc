#include "krot/model/derived_models.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model/rigs.h"
#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// Three cameras and a point within 100 m of `around`.
Model ModelAround(const Vector3d& around) {
  Model model = TinyModel();
  model.points3D.resize(1);
  model.points3D[0].track_begin = model.points3D[0].track_end = 0;
  model.track_elements.clear();
  model.points3D[0].xyz = around + Vector3d(3, 1.0 / 3, 7);
  for (size_t n = 0; n < model.images.size(); ++n) {
    Pose& pose = model.images[n].cam_from_world;
    pose.translation =
        -(pose.Rotation() *
          (around + 50.0 * Vector3d(std::cos(n), std::sin(n), 0.1)));
  }
  UseTrivialRigs(&model);
  return model;
}

const Vector3d kFarAway(5e6, -3e6, 4e6);

TEST(LocalFrame, IsTheModelsWhereThatIsAmidTheModel) {
  const Model model = ModelAround({20, 10, 0});
  const LocalFrame frame(model);
  EXPECT_TRUE(frame.IsModels());
  EXPECT_THAT(frame.ToLocal(model), IsModel(model));
  EXPECT_TRUE(LocalFrame(TinyModel()).IsModels());
}

TEST(LocalFrame, PutsItsOriginAmidAModelFarAwayAndTakesTheModelAlong) {
  const Model model = ModelAround(kFarAway);
  const LocalFrame frame(model);
  EXPECT_LT((frame.origin() - kFarAway).norm(), 200);
  const Model local = frame.ToLocal(model);
  EXPECT_EQ(local.points3D[0].xyz, model.points3D[0].xyz - frame.origin());
  const auto was = ImageGeometries(model);
  const auto is = ImageGeometries(local);
  for (size_t n = 0; n < was.size(); ++n) {
    EXPECT_LT((Center(is[n].cam_from_world) + frame.origin() -
               Center(was[n].cam_from_world))
                  .norm(),
              1e-8);
    EXPECT_EQ(local.images[n].cam_from_world.translation,
              local.frames[is[n].frame].rig_from_world.translation);
  }
}

TEST(LocalFrame, IsAmidAModelTenExtentsAway) {
  // The cameras are some 50 m apart.
  EXPECT_TRUE(LocalFrame(ModelAround({0, 100, 0})).IsModels());
  EXPECT_FALSE(LocalFrame(ModelAround({0, 1000, 0})).IsModels());
}

TEST(LocalFrame, GivesWhatStaysThereItsBitsBack) {
  Model model = ModelAround(kFarAway);
  model.points3D.push_back(model.points3D[0]);
  model.points3D[1].id = 1;
  model.points3D[1].xyz = Vector3d(0.1, 1e-9, 1e9);  // not amid it
  model.images[1].cam_from_world.translation.setConstant(
      std::numeric_limits<double>::quiet_NaN());
  UseTrivialRigs(&model);
  const LocalFrame frame(model);
  ASSERT_FALSE(frame.IsModels());
  Model local = frame.ToLocal(model);
  EXPECT_THAT(frame.FromLocal(model, local), IsModel(model));

  local.points3D[0].xyz += Vector3d(0.5, 0, 0);
  const Model moved = frame.FromLocal(model, local);
  EXPECT_EQ(moved.points3D[0].xyz, model.points3D[0].xyz + Vector3d(0.5, 0, 0));
  EXPECT_EQ(moved.points3D[1].xyz, model.points3D[1].xyz);
}

TEST(LocalFrame, IsAmidWhatIsFixed) {
  Model model = ModelAround(Vector3d::Zero());
  model.points3D.push_back(model.points3D[0]);
  model.points3D[0].xyz = kFarAway;
  model.points3D[1].id = 1;
  model.points3D[1].xyz = kFarAway + Vector3d(10, 0, 0);
  FixedParts fixed;
  fixed.points3D.assign(2, 1);
  EXPECT_TRUE(LocalFrame(model).IsModels());
  EXPECT_LT((LocalFrame(model, fixed).origin() - kFarAway).norm(), 20);
}

}  // namespace
}  // namespace krot::internal
