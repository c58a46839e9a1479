#include "krot/analysis/model_statistics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <stdexcept>

#include "krot/model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Color = std::array<uint8_t, 3>;

constexpr double kNoError = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Three points with tracks of two, one and two observations.
Model ThreePoints() {
  Model model;
  model.track_elements.resize(5);
  model.points3D.resize(3);
  model.points3D[0].track_end = 2;
  model.points3D[1].track_begin = 2;
  model.points3D[1].track_end = 3;
  model.points3D[2].track_begin = 3;
  model.points3D[2].track_end = 5;
  return model;
}

TEST(ErrorColor, RunsFromBlueByGreenToRed) {
  const Color none = ErrorColor(0, 4);
  const Color middle = ErrorColor(1.6, 4);
  const Color top = ErrorColor(4, 4);
  EXPECT_GT(none[2], std::max(none[0], none[1]));
  EXPECT_GT(middle[1], std::max(middle[0], middle[2]));
  EXPECT_GT(top[0], std::max(top[1], top[2]));
}

TEST(ErrorColor, DependsOnTheShareOfTheTopAlone) {
  for (const double share : {0.0, 0.1, 0.33, 0.5, 0.9, 1.0}) {
    EXPECT_EQ(ErrorColor(share * 4, 4), ErrorColor(share * 8, 8)) << share;
  }
  EXPECT_EQ(ErrorColor(1000, 4), ErrorColor(4, 4));
}

TEST(ErrorColor, TellsHundredthsOfTheTopApart) {
  std::set<Color> colors;
  for (int i = 0; i <= 100; ++i) colors.insert(ErrorColor(i, 100));
  EXPECT_EQ(colors.size(), 101u);
}

TEST(ColorPointsByError, TakesTheLargestOfTheTrack) {
  Model model = ThreePoints();
  ColorPointsByError({1, 3, 2, 0.5, kNoError}, 4, &model);
  EXPECT_EQ(model.points3D[0].color, ErrorColor(3, 4));
  EXPECT_EQ(model.points3D[1].color, ErrorColor(2, 4));
  EXPECT_EQ(model.points3D[2].color, ErrorColor(0.5, 4));
}

TEST(ColorPointsByError, IsGreyWhereNoErrorIsFinite) {
  Model model = ThreePoints();
  ColorPointsByError({1, 3, 2, kInfinity, kNoError}, 4, &model);
  EXPECT_EQ(model.points3D[2].color, (Color{128, 128, 128}));
}

TEST(ColorPointsByError, ChangesNothingButColors) {
  SceneOptions options = SceneOf(4, 30, 3, 1);
  const Model scene = SynthesizeScene(options).model;
  Model model = scene;
  ColorPointsByError(PixelErrors(model), 4, &model);
  EXPECT_NE(model.points3D[0].color, scene.points3D[0].color);
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    model.points3D[k].color = scene.points3D[k].color;
  }
  EXPECT_THAT(model, IsModel(scene));
}

}  // namespace
}  // namespace krot::internal
