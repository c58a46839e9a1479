#include "krot/model/fixed_parts.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(FixedParts, AreTheFramesOfImagesByNameAndById) {
  const Model model = TinyRigModel();
  EXPECT_THAT(FixedFrames({"f.txt", "# \n\nleft/a b.jpg \n"}, model),
              ElementsAre(0, 1, 0));
  EXPECT_THAT(FixedFrames({"f.txt", "9\r\n"}, model), ElementsAre(1, 0, 0));
  EXPECT_THAT(FixedFrames({"f.txt", "c.jpg\n4000000000\nc.jpg"}, model),
              ElementsAre(1, 1, 0));
}

TEST(FixedParts, AreOfTheImageOfANameRatherThanOfAnId) {
  Model model = TinyModel();
  model.images[0].name = "9";
  EXPECT_THAT(FixedFrames({"f.txt", "9"}, model), ElementsAre(1, 0, 0));
}

TEST(FixedParts, ArePointsById) {
  EXPECT_THAT(FixedPoints3D({"f.txt", "12\n5000000000\n"}, TinyModel()),
              ElementsAre(1, 0, 1));
}

TEST(FixedParts, ThatAreNotThereAreRefusedWithTheirLine) {
  Model model = TinyModel();
  const auto images = [&](const std::string& text) {
    return ModelErrorOf([&] { FixedFrames({"f.txt", text}, model); });
  };
  const auto points = [&](const std::string& text) {
    return ModelErrorOf([&] { FixedPoints3D({"f.txt", text}, model); });
  };
  EXPECT_THAT(images("c.jpg\nd.jpg"), HasSubstr("f.txt:2: found \"d.jpg\""));
  EXPECT_THAT(images("8"), HasSubstr("f.txt:1: found \"8\""));
  EXPECT_THAT(images("empty.png"), HasSubstr("which stands nowhere"));
  EXPECT_THAT(images("#"), HasSubstr("f.txt: found no line"));
  EXPECT_THAT(points("7"), HasSubstr("f.txt:1: found \"7\""));
  EXPECT_THAT(points("12 1"), HasSubstr("f.txt:1: found \"12 1\""));
  EXPECT_THAT(points(""), HasSubstr("f.txt: found no line"));
  model.images[1].name = "c.jpg";
  EXPECT_THAT(images("c.jpg"), HasSubstr("which several images"));
}

}  // namespace
}  // namespace krot
