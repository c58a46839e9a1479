#include "tests/testing/model_matchers.h"

#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/model/tiny_model.h"

namespace krot::internal {
namespace {

std::string DifferenceAfter(const std::function<void(Model*)>& change,
                            const Ignoring& ignoring = Ignoring()) {
  Model changed = TinyRigModel();
  change(&changed);
  return ModelComparison(ignoring).FirstDifference(TinyRigModel(), changed);
}

TEST(IsModel, SaysWhereTwoModelsDifferFirst) {
  EXPECT_EQ(DifferenceAfter([](Model*) {}), "");
  EXPECT_EQ(DifferenceAfter([](Model* m) { m->cameras[1].params[2] = 0.0; }),
            "cameras[1].params[2]: -0 and 0");
  EXPECT_EQ(DifferenceAfter([](Model* m) { m->images.pop_back(); }),
            "images.size(): 3 and 2");
  EXPECT_EQ(DifferenceAfter([](Model* m) {
              m->points3D[0].color = {255, 1, 9};
            }),
            "points3D[0].color[1]: 0 and 1");
  EXPECT_EQ(DifferenceAfter([](Model* m) { m->frames[1].data[0].data_id = 2; }),
            "frames[1].data[0].data_id: 4000000000 and 2");
}

TEST(IsModel, IgnoresOnlyWhatItIsToldTo) {
  const Ignoring everything{true, true, true};
  const auto move = [](Model* m) {
    m->images[0].cam_from_world.translation[0] = 7;
    m->frames[0].rig_from_world.translation[1] = 7;
    m->points3D[1].xyz[2] = 7;
    m->points3D[1].error = 7;
  };
  EXPECT_EQ(DifferenceAfter(move, everything), "");
  EXPECT_EQ(DifferenceAfter(move, {false, true, true}),
            "frames[0].rig_from_world.translation[1]: 2 and 7");
  EXPECT_EQ(DifferenceAfter(move, {true, false, true}),
            "points3D[1].xyz[2]: 4 and 7");
  EXPECT_EQ(DifferenceAfter(move, {true, true, false}),
            "points3D[1].error: -1 and 7");
  EXPECT_EQ(DifferenceAfter(
                [](Model* m) {
                  m->rigs[0].sensors[0].sensor_from_rig->translation[1] = 7;
                },
                everything),
            "rigs[0].sensors[0].sensor_from_rig.translation[1]: "
            "0.29999999999999999 and 7");
}

}  // namespace
}  // namespace krot::internal
