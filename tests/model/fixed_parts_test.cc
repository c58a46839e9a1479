#include "krot/model/model_io.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/context.h"
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

std::vector<KnownDistance> Read(const Model& model, const std::string& text,
                                bool may_lack_metres = false) {
  return ReadDistances({"bars.txt", text}, model, may_lack_metres);
}

std::string RefusalOf(const Model& model, const std::string& text,
                      bool may_lack_metres = false) {
  return ModelErrorOf([&] { Read(model, text, may_lack_metres); });
}

TEST(ReadDistances, TakesImagesAndPointsByTheirNames) {
  Model model = TinyModel();
  model.images[0].name = "left one.jpg";
  const std::string first = model.images[0].name;
  const std::string second = model.images[1].name;
  const std::string point1 = std::to_string(model.points3D[0].id);
  const std::string point2 = std::to_string(model.points3D[1].id);
  const auto distances =
      Read(model, "from,to,m,within\n# a bar\n" + first + " " + second +
                      " 1.5 .01\r\n\"" + second + "\",\"" + first + "\",2,3\n" +
                      point1 + " " + point2 + " 4 5\n" + first + "\t" + point2 +
                      "\t6\t7\n");
  ASSERT_EQ(distances.size(), 4u);
  EXPECT_EQ(NameOf(model, distances[0]), first + " to " + second);
  EXPECT_EQ(distances[0].metres, 1.5);
  EXPECT_EQ(distances[0].tolerance, 0.01);
  EXPECT_EQ(NameOf(model, distances[1]), second + " to " + first);
  EXPECT_EQ(NameOf(model, distances[2]),
            "3D point " + point1 + " to 3D point " + point2);
  EXPECT_EQ(NameOf(model, distances[3]), first + " to 3D point " + point2);
  EXPECT_EQ(distances[3].tolerance, 7);
}

TEST(ReadDistances, MayBeWithoutMetresWhereLengthsAreAskedFor) {
  const Model model = TinyModel();
  const std::string points = std::to_string(model.points3D[0].id) + " " +
                             std::to_string(model.points3D[1].id);
  EXPECT_FALSE(Read(model, points + "\n", true)[0].metres);
  EXPECT_EQ(Read(model, points + " 3 .5\n", true)[0].metres, 3);
  EXPECT_THAT(RefusalOf(model, points + "\n"), HasSubstr("bars.txt:1: found"));
}

TEST(ReadDistances, RefusesWhatIsNoDistance) {
  const Model model = TinyModel();
  const std::string pair = model.images[0].name + " " + model.images[1].name;
  for (const auto& [text, part] :
       std::vector<std::pair<std::string, std::string>>{
           {"", "found no line"},
           {pair + " 1\n", "METRES and TOLERANCE"},
           {pair + " 0 1\n", "found \"0\", expected METRES and TOLERANCE from"},
           {pair + " 1 -1\n", "found \"-1\""},
           {pair + " 1e13 1\n", "found \"1e+13\""},
           {pair + " nan 1\n", "finite numbers"},
           {pair + " 1 inf\n", "finite numbers"},
           {pair + " 1,5 ,1\n", "decimal point"},
           {model.images[0].name + " " + model.images[0].name + " 1 1\n",
            "the same twice"},
           {model.images[0].name + " 1 .1\n", "found"},
           {"nobody.jpg " + model.images[0].name + " 1 .1\n",
            "found no pair of the model in its 1 line"}}) {
    SCOPED_TRACE(text);
    EXPECT_THAT(RefusalOf(model, text), HasSubstr(part));
  }
}

std::vector<KnownDistance> Distances(const std::vector<double>& metres,
                                     const std::vector<double>& tolerances) {
  std::vector<KnownDistance> distances(metres.size());
  for (size_t n = 0; n < metres.size(); ++n) {
    distances[n].metres = metres[n];
    distances[n].tolerance = tolerances[n];
  }
  return distances;
}

TEST(FindScale, OfOneDistanceIsItsOwn) {
  const auto scale = FindScale({0.5}, Distances({3}, {0.1}));
  ASSERT_TRUE(scale);
  EXPECT_DOUBLE_EQ(scale->scale, 6);
  EXPECT_DOUBLE_EQ(scale->lowest, 5.8);
  EXPECT_DOUBLE_EQ(scale->highest, 6.2);
  EXPECT_TRUE(scale->is_unique);
}

TEST(FindScale, NamesTheOneThatContradictsTheOthers) {
  const auto scale =
      FindScale({1, 2, 3}, Distances({2, 4.4, 6.01}, {0.05, 0.05, 0.05}));
  ASSERT_TRUE(scale);
  EXPECT_THAT(scale->agrees, testing::ElementsAre(1, 0, 1));
  EXPECT_NEAR(scale->scale, 2, 0.01);
}

TEST(FindScale, HasNoMajorityOfTwoThatContradictEachOther) {
  const auto scale = FindScale({1, 1}, Distances({2, 3}, {0.1, 0.1}));
  ASSERT_TRUE(scale);
  EXPECT_EQ(scale->num_agreeing, 1);
  EXPECT_FALSE(scale->is_unique);
}

TEST(FindScale, NeedsALengthAndMetres) {
  EXPECT_FALSE(FindScale({0.0, NAN}, Distances({2, 3}, {0.1, 0.1})));
  EXPECT_FALSE(FindScale({1}, std::vector<KnownDistance>(1)));
}

// All subsets tried.
TEST(FindScale, AgreesWithTheLargestOfAllSubsets) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> uniform(0.5, 2);
  for (int trial = 0; trial < 200; ++trial) {
    constexpr size_t kCount = 8;
    std::vector<double> lengths, metres, tolerances;
    for (size_t n = 0; n < kCount; ++n) {
      lengths.push_back(uniform(generator));
      metres.push_back(3 * lengths[n] * (n < 5 ? 1 : uniform(generator)));
      tolerances.push_back(0.1 * uniform(generator));
    }
    const auto scale = FindScale(lengths, Distances(metres, tolerances));
    size_t largest = 0;
    for (unsigned set = 1; set < 1u << kCount; ++set) {
      double low = 0, high = 1e9;
      for (size_t n = 0; n < kCount; ++n) {
        if ((set >> n & 1) == 0) continue;
        low = std::max(low, (metres[n] - tolerances[n]) / lengths[n]);
        high = std::min(high, (metres[n] + tolerances[n]) / lengths[n]);
      }
      if (low <= high) {
        largest = std::max(largest, std::bitset<kCount>(set).count());
      }
    }
    ASSERT_TRUE(scale);
    EXPECT_EQ(static_cast<size_t>(scale->num_agreeing), largest);
    for (size_t n = 0; n < kCount; ++n) {
      if (scale->agrees[n] == 0) continue;
      EXPECT_LE(std::abs(scale->scale * lengths[n] - metres[n]),
                tolerances[n] * (1 + 1e-12));
    }
  }
}

}  // namespace
}  // namespace krot::internal
