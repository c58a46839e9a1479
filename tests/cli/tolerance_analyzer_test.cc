#include <algorithm>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

namespace krot::internal {
namespace {

class ToleranceAnalyzer : public ::testing::Test {
 protected:
  ToleranceAnalyzer() : model_(SynthesizeScene(Scene()).model) {
    // An id that no int holds.
    constexpr ImageId kLarge = 3000000000;
    const ImageId id = std::exchange(model_.images[2].id, kLarge);
    for (TrackElement& element : model_.track_elements) {
      if (element.image_id == id) element.image_id = kLarge;
    }
    for (Frame& frame : model_.frames) {
      for (FrameData& data : frame.data) {
        if (data.data_id == id) data.data_id = kLarge;
      }
    }
    Save(model_, folder_ / "input");
    max_error_ = std::to_string(1.2 * Summarize(PixelErrors(model_)).max);
  }

  static SceneOptions Scene() {
    SceneOptions options = SmallScene();
    options.start_translation_noise = options.start_point_noise = 0;
    return options;
  }
  KrotResult Analyze(const Words& more,
                     const std::string& input = "input") const {
    return RunKrot(
        {"tolerance_analyzer", "--input_path", folder_ / input, "--report_path",
         folder_ / "r.json", "--ToleranceAnalyzer.max_error", max_error_},
        more);
  }
  Json Report() const { return ReadJson(folder_ / "r.json"); }

  TempFolder folder_;
  Model model_;
  std::string max_error_;
};

TEST_F(ToleranceAnalyzer, TellsTheSameInTableReportCsvAndPage) {
  const std::string point = std::to_string(model_.points3D[3].id);
  const KrotResult result = Succeeded(Analyze(
      {"--csv_path", folder_ / "boxes.csv", "--html_path", folder_ / "p.html",
       "--ToleranceAnalyzer.images",
       model_.images[1].name + "," + std::to_string(model_.images[2].id),
       "--ToleranceAnalyzer.points", point, "--log_level", "2"}));
  EXPECT_THAT(result.err, HasSubstr("box 1 of 3"));
  EXPECT_THAT(result.err, Not(HasSubstr("box 0 of")));
  EXPECT_THAT(result.out, HasSubstr(model_.images[1].name));
  EXPECT_THAT(result.out, HasSubstr("point " + point));
  const Json report = Report();
  ASSERT_EQ(report["boxes"].size(), 3u);
  EXPECT_EQ(report["boxes"][1]["image_id"], model_.images[2].id);
  EXPECT_EQ(report["boxes"][2]["point3D_id"], model_.points3D[3].id);
  EXPECT_EQ(report["gauge"]["images"].size(), 2u);
  std::istringstream csv(ReadBytes(folder_ / "boxes.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line,
            "image_id,image_name,point3D_id,axis,position,low_proved,"
            "low_reached,high_reached,high_proved");
  for (const Json& box : report["boxes"]) {
    for (int axis = 0; axis < 3; ++axis) {
      const double position = box["position"][axis];
      EXPECT_LE(box["low"]["proved"][axis], box["low"]["reached"][axis]);
      EXPECT_LE(box["low"]["reached"][axis], position);
      EXPECT_LE(position, box["high"]["reached"][axis]);
      EXPECT_LE(box["high"]["reached"][axis], box["high"]["proved"][axis]);
      ASSERT_TRUE(std::getline(csv, line));
      const std::string last = line.substr(line.rfind(',') + 1);
      EXPECT_EQ(std::stod(last), box["high"]["proved"][axis]);
    }
  }
  EXPECT_FALSE(std::getline(csv, line));
  EXPECT_THAT(ReadBytes(folder_ / "p.html"), HasSubstr("boxes-section"));
}

TEST_F(ToleranceAnalyzer, ListsTheWidestOfManyBoxes) {
  const KrotResult result = Succeeded(Analyze({"--num_worst", "2"}));
  EXPECT_THAT(result.out, HasSubstr("the 2 widest of 6, --csv_path has all"));
  const auto width = [](const Json& box) {
    double largest = 0;
    for (int axis = 0; axis < 3; ++axis) {
      if (box["low"]["proved"][axis].is_null() ||
          box["high"]["proved"][axis].is_null()) {
        return std::numeric_limits<double>::infinity();
      }
      largest = std::max(largest, box["high"]["proved"][axis].get<double>() -
                                      box["low"]["proved"][axis].get<double>());
    }
    return largest;
  };
  const Json boxes = Report()["boxes"];
  for (const Json& box : boxes) {
    const std::string name = box["image_name"];
    const auto num_wider = std::count_if(
        boxes.begin(), boxes.end(),
        [&](const Json& other) { return width(other) > width(box); });
    EXPECT_EQ(result.out.find("\n  " + name) != std::string::npos,
              num_wider < 2)
        << result.out;
  }
}

// Of each model an end lies between what is proved and what is reached.
TEST_F(ToleranceAnalyzer, ShiftsItsBoxesWithTheModel) {
  const Eigen::Vector3d shift(5e6, -4e6, 3e6);
  Save(FarAway(model_, Eigen::Vector3d::Zero()), folder_ / "near");
  Save(FarAway(model_, shift), folder_ / "far");
  Succeeded(Analyze({}, "near"));
  const Json here = Report();
  Succeeded(Analyze({}, "far"));
  const Json there = Report();
  ASSERT_EQ(here["boxes"].size(), model_.images.size());
  for (size_t n = 0; n < model_.images.size(); ++n) {
    for (const auto& [side, sign] : {std::pair("low", -1), {"high", 1}}) {
      const Json& a = here["boxes"][n][side];
      const Json& b = there["boxes"][n][side];
      for (int axis = 0; axis < 3; ++axis) {
        const auto at = [&](const Json& end, const char* what) {
          return sign * end[what][axis].get<double>();
        };
        const double moved = sign * shift[axis];
        EXPECT_LE(at(a, "reached") + moved, at(b, "proved") + 1e-6);
        EXPECT_LE(at(b, "reached"), at(a, "proved") + moved + 1e-6);
      }
    }
  }
}

TEST_F(ToleranceAnalyzer, SaysOfAModelFarAwayWhatItSaysOfItNearby) {
  const auto sentence = [&](const Eigen::Vector3d& shift) {
    Save(FarAway(model_, shift), folder_ / "shifted");
    const std::string out = Analyze({}, "shifted").out;
    const size_t begin = out.find("estimates that were met");
    return out.substr(begin, out.find(" %", begin) - begin);
  };
  const std::string nearby = sentence({0, 0, 0});
  EXPECT_THAT(nearby, HasSubstr("to within"));
  for (const double distance : {1e4, 1e6, 1e7}) {
    const std::string far = sentence(distance * Eigen::Vector3d(1, -2, 0.5));
    const Json report = Report();
    // To one per cent, as asked for, and a little that rounding decides.
    EXPECT_LT(report["agreement"]["worst"], 0.015) << nearby << "; " << far;
    EXPECT_EQ(report["agreement"]["num_ends"], 6 * model_.images.size());
    const std::string still = report["gauge"]["images"][0];
    for (const Json& box : report["boxes"]) {
      if (box["image_name"] != still) continue;
      EXPECT_EQ(box["low"]["proved"], box["position"]);
      EXPECT_EQ(box["high"]["proved"], box["position"]);
    }
  }
}

TEST_F(ToleranceAnalyzer, RefusesWhatTheModelDoesNotHave) {
  for (const auto& [option, value] :
       std::vector<std::pair<std::string, std::string>>{
           {"images", "nobody.jpg"},
           {"points", "123456789"},
           {"gauge_images", model_.images[0].name},
           {"gauge_images",
            model_.images[0].name + "," + model_.images[0].name},
       }) {
    const KrotResult result = Analyze({"--ToleranceAnalyzer." + option, value});
    EXPECT_EQ(result.exit_code, 1) << option;
    EXPECT_THAT(result.err, HasSubstr("--ToleranceAnalyzer." + option));
    EXPECT_THAT(result.err, HasSubstr(value));
  }
}

TEST_F(ToleranceAnalyzer, ProvesThatNoEstimateIsWithinABoundThatIsTooLow) {
  const KrotResult result =
      RunKrot({"tolerance_analyzer", "--input_path", folder_ / "input",
               "--ToleranceAnalyzer.max_error", "0.01"});
  EXPECT_EQ(result.exit_code, 7);
  EXPECT_THAT(result.err, HasSubstr("is proved to be at least"));
  EXPECT_EQ(result.out, "");
}

TEST_F(ToleranceAnalyzer, KeepsWhatIsFixedAndTakesItForTheGauge) {
  std::ofstream(folder_ / "fixed.txt") << model_.images[0].name << '\n'
                                       << model_.images.back().name << '\n';
  Succeeded(Analyze({"--fixed_images_path", folder_ / "fixed.txt"}));
  const Json report = Report();
  EXPECT_EQ(report["gauge"]["num_fixed_frames"], 2);
  EXPECT_TRUE(report["gauge"]["images"].empty());
  EXPECT_EQ(report["boxes"][0]["low"], report["boxes"][0]["high"]);
  EXPECT_NE(report["boxes"][1]["low"], report["boxes"][1]["high"]);
}

}  // namespace
}  // namespace krot::internal
