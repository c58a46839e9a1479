#include "krot/model/model_io.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
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

TEST(FixedParts, ThatAreNotThereAreSkippedAndCounted) {
  std::string notes;
  const FileNote note = [&](const std::string& text) { notes += text + "\n"; };
  EXPECT_THAT(FixedFrames({"f.txt", "d.jpg\nC:\\photos\\c.jpg\n8\n9"},
                          TinyRigModel(), note),
              ElementsAre(1, 0, 0));
  EXPECT_EQ(notes,
            "f.txt: skipped 2 of 4 lines, whose image the model does not have; "
            "the first has image \"d.jpg\"\n"
            "f.txt: paths are taken for the names that they end with, "
            "\"C:\\photos\\c.jpg\" for \"c.jpg\", for one\n");
  notes.clear();
  EXPECT_THAT(FixedPoints3D({"f.txt", "12.0\n7\n"}, TinyModel(), note),
              ElementsAre(0, 0, 1));
  EXPECT_EQ(notes,
            "f.txt: skipped 1 of 2 lines, whose 3D point the model does not "
            "have; the first has 3D point 7\n");
}

TEST(FixedParts, OfWhichNoneIsThereAreRefused) {
  Model model = TinyModel();
  const auto images = [&](const std::string& text) {
    return ModelErrorOf([&] { FixedFrames({"f.txt", text}, model); });
  };
  const auto points = [&](const std::string& text) {
    return ModelErrorOf([&] { FixedPoints3D({"f.txt", text}, model); });
  };
  EXPECT_EQ(images("8\nd.jpg"),
            "f.txt: found no image of the model in its 2 lines, the first has "
            "image \"8\"; expected those of the model, such as image "
            "\"left/a b.jpg\"");
  EXPECT_THAT(images("empty.png"), HasSubstr("which stands nowhere"));
  EXPECT_THAT(images("#"), HasSubstr("f.txt: found no line"));
  EXPECT_THAT(points("7"), HasSubstr("the first has 3D point 7; expected"));
  EXPECT_THAT(points("12 1"), HasSubstr("the first has 3D point 12 1"));
  EXPECT_THAT(points(""), HasSubstr("f.txt: found no line"));
  model.images[1].name = "c.jpg";
  EXPECT_THAT(images("c.jpg"), HasSubstr("which several images"));
}

}  // namespace
}  // namespace krot::internal
