#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/geometry.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "tests/cli/known_fixture.h"
#include "tests/cli/scenes.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// A model whose unit is 40 m, in UTM coordinates, and what else is known of it.
class Metres : public Known {
 protected:
  void SetUp() override { Save(model_, folder_ / "input"); }

  Vector3d CentreOf(const Model& model, size_t image) const {
    return Center(ImageGeometries(model)[image].cam_from_world);
  }
  Vector3d Own(size_t image) const {
    return own_from_model_ * CentreOf(model_, image);
  }
  // One of them off by 100 m.
  void WritePositions(const std::string& radius) const {
    std::ofstream file(folder_ / "positions.txt");
    file.precision(17);
    for (size_t n = 0; n < model_.images.size(); ++n) {
      const double phase = static_cast<double>(n);
      Vector3d xyz =
          Own(n) + 0.05 * Vector3d(std::sin(7 * phase), std::sin(8 * phase),
                                   std::sin(9 * phase));
      if (n == kWrong) xyz.y() += 100;
      file << model_.images[n].name << ' ' << xyz.transpose() << ' ' << radius
           << '\n';
    }
  }
  KrotResult SolveIn(const std::string& frame, const std::string& output,
                     Words more = {}) const {
    return Solve(
        "input", output,
        more + Words{"--positions_path", folder_ / "positions.txt",
                     "--positions_frame", "own", "--output_frame", frame});
  }
  // "NAME1 NAME2 METRES TOLERANCE" at 40 m a unit, times `factor`.
  std::string Distance(size_t a, size_t b, double within,
                       double factor = 1) const {
    std::ostringstream line;
    line.precision(17);
    line << model_.images[a].name << ' ' << model_.images[b].name << ' '
         << factor * (Own(a) - Own(b)).norm() << ' ' << within << '\n';
    return line.str();
  }
  KrotResult SolveWith(const std::string& distances, const std::string& output,
                       Words more = {}) const {
    WriteBytes(folder_ / "bars.txt", distances);
    return Solve("input", output,
                 more + Words{"--distances_path", folder_ / "bars.txt"});
  }

  static constexpr size_t kWrong = 2;
  const Model model_ = SmallLegacyModel();
  const Similarity own_from_model_ = {
      40, Eigen::Quaterniond(1, 2, -3, 4).normalized().matrix(),
      Vector3d(454000, 5412000, 310)};
};

TEST_F(Metres, OfPositionsInTheirOwnFrameNameTheWrongOne) {
  WritePositions("0.5");
  const KrotResult result = Succeeded(SolveIn("model", "output"));
  EXPECT_THAT(result.err, HasSubstr("the position of " +
                                    model_.images[kWrong].name + " is "));
  EXPECT_THAT(result.err, HasSubstr("m off, its radius is 0.5 m: left out"));
  const Json frame = Report("output")["positions"]["frame"];
  EXPECT_EQ(frame["wrong"].size(), 1u);
  EXPECT_EQ(frame["wrong"][0]["name"], model_.images[kWrong].name);
  EXPECT_NEAR(frame["wrong"][0]["distance"], 100, 0.5);
  EXPECT_NEAR(frame["scale"], 40, 0.1);
  EXPECT_EQ(frame["is_written"], false);
  EXPECT_EQ(Report("output")["positions"]["num_known"],
            model_.images.size() - 1);
  // The model's frame stays, and each camera is in its ball.
  const Model after = Load(folder_ / "output");
  for (size_t n = 0; n < model_.images.size(); ++n) {
    if (n == kWrong) continue;
    EXPECT_LE((CentreOf(after, n) - CentreOf(model_, n)).norm(), 0.6 / 40);
  }
  Succeeded(Check("input", "output"));
}

TEST_F(Metres, OfTheWrittenModelAreThePositionsOwnOnRequest) {
  WritePositions("0.5");
  Succeeded(SolveIn("model", "model"));
  Succeeded(SolveIn("own", "own"));
  const Json in_model = Report("model");
  const Json in_own = Report("own");
  EXPECT_EQ(in_own["positions"]["frame"]["is_written"], true);
  EXPECT_NEAR(in_own["pixel_error"]["after"]["max"],
              in_model["pixel_error"]["after"]["max"], 1e-6);
  const Model after = Load(folder_ / "own");
  const Model there = Load(folder_ / "model");
  EXPECT_NEAR(Summarize(PixelErrors(after)).max,
              Summarize(PixelErrors(there)).max, 1e-6);
  for (size_t n = 0; n < model_.images.size(); ++n) {
    if (n != kWrong) {
      EXPECT_LE((CentreOf(after, n) - Own(n)).norm(), 0.6);
    }
    EXPECT_EQ(after.images[n].points2D.size(), there.images[n].points2D.size());
  }
}

TEST_F(Metres, NeedNoRadiusInTheirOwnFrame) {
  WritePositions("");
  const KrotResult result = Succeeded(SolveIn("own", "output"));
  EXPECT_THAT(result.err, HasSubstr("as the file has none"));
  EXPECT_EQ(Report("output")["positions"]["frame"]["wrong"].size(), 1u);
}

TEST_F(Metres, RefusePositionsThatSayNothingOfAFrame) {
  const auto refuse = [&](const std::string& text, const std::string& part) {
    WriteBytes(folder_ / "positions.txt", text);
    EXPECT_THAT(SolveIn("own", "refused"), IsRefused(2, "krot solver", part))
        << text;
  };
  const auto line = [&](size_t n, const std::string& rest) {
    return model_.images[n].name + " " + rest + "\n";
  };
  refuse(line(0, "1 2 3 1") + line(1, "4 5 6 1"), "found 2 positions");
  refuse(line(0, "0 0 0 1") + line(1, "1 0 0 1") + line(2, "2 0 0 1"),
         "expected");
  refuse(line(0, "0 0 nan 1"), "finite");
  refuse(line(0, "0 0 0 1") + line(1, "1 0 0"), "no RADIUS");
  refuse("name,latitude,longitude,height\n" + line(0, "48.1 11.5 500 1"),
         "in metres; tools/scripts/geodetic_to_positions.sh");
  for (const auto& [option, value, why] :
       std::vector<std::array<std::string, 3>>{
           {"--positions_frame", "own", "without --positions_path"},
           {"--output_frame", "own", "without --positions_frame own"}}) {
    const KrotResult result = Solve("input", "refused", {option, value});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, HasSubstr(option + " has no effect " + why));
  }
}

TEST_F(Metres, OfOneDistanceSetTheScale) {
  Succeeded(SolveWith(Distance(0, 3, 0.01), "output"));
  const Model after = Load(folder_ / "output");
  EXPECT_NEAR((CentreOf(after, 0) - CentreOf(after, 3)).norm(),
              (Own(0) - Own(3)).norm(), 1e-9);
  const Json report = Report("output");
  EXPECT_EQ(report["distances"]["is_scale_taken"], true);
  EXPECT_NEAR(Summarize(PixelErrors(after)).max,
              report["pixel_error"]["after"]["max"], 1e-9);
  Succeeded(Check("input", "output"));
}

TEST_F(Metres, OfSeveralDistancesNameTheOneThatContradicts) {
  const std::string distances =
      Distance(0, 3, 0.5) + Distance(1, 4, 0.5, 1.5) + Distance(2, 5, 0.5);
  const KrotResult result = Succeeded(SolveWith(distances, "output"));
  EXPECT_THAT(result.err,
              HasSubstr("warning: the distance of " + model_.images[1].name +
                        " to " + model_.images[4].name));
  const Json list = Report("output")["distances"]["distances"];
  EXPECT_EQ(list[0]["is_contradicted"], false);
  EXPECT_EQ(list[1]["is_contradicted"], true);
  EXPECT_EQ(list[2]["is_contradicted"], false);
}

TEST_F(Metres, AreRefusedWhereDistancesHaveNoMajority) {
  for (const auto& [text, part] :
       std::vector<std::pair<std::string, std::string>>{
           {Distance(0, 3, 0.01) + Distance(1, 4, 0.01, 1.5),
            "contradict each other"},
           {"nobody.jpg no.jpg 1 1\n", "found no pair"},
           {model_.images[0].name + " " + model_.images[1].name + " x 1\n",
            "METRES and TOLERANCE"},
           {model_.images[0].name + " " + model_.images[1].name + " nan 1\n",
            "finite numbers"}}) {
    EXPECT_THAT(SolveWith(text, "refused"), IsRefused(2, "krot solver", part));
  }
}

TEST_F(Metres, OfDistancesAreCheckedAgainstPositions) {
  WritePositions("0.5");
  WriteBytes(folder_ / "bars.txt",
             Distance(0, 3, 1.5) + Distance(1, 4, 1.5, 1.5));
  Succeeded(
      SolveIn("own", "output", {"--distances_path", folder_ / "bars.txt"}));
  const Json distances = Report("output")["distances"];
  EXPECT_EQ(distances["is_scale_taken"], false);
  EXPECT_EQ(distances["distances"][0]["is_contradicted"], false);
  EXPECT_EQ(distances["distances"][1]["is_contradicted"], true);
}

TEST_F(Metres, OfDistancesAreShownByAnalyzerAndComparer) {
  Succeeded(SolveWith(Distance(0, 3, 0.01), "output"));
  const KrotResult analyzed = Succeeded(RunKrot(
      {"model_analyzer", "--path", folder_ / "output", "--distances_path",
       folder_ / "bars.txt", "--report_path", folder_ / "a.json"}));
  EXPECT_THAT(analyzed.out, HasSubstr("a unit of the model is 1 m"));
  const Json report = ReadJson(folder_ / "a.json");
  EXPECT_NEAR(report["distances"]["distances"][0]["model"],
              (Own(0) - Own(3)).norm(), 1e-9);
  Succeeded(
      RunKrot({"model_comparer", "--input_path1", folder_ / "input",
               "--input_path2", folder_ / "output", "--distances_path",
               folder_ / "bars.txt", "--report_path", folder_ / "c.json"}));
  const Json both = ReadJson(folder_ / "c.json")["distances"];
  EXPECT_NEAR(both["scales"]["model1"]["metres_per_unit"].get<double>(), 40,
              1e-3);
  EXPECT_NEAR(both["scales"]["model2"]["metres_per_unit"].get<double>(), 1,
              1e-9);
}

TEST_F(Metres, OfLengthsAreBoundedByToleranceAnalyzer) {
  WriteBytes(folder_ / "bars.txt",
             Distance(0, 3, 0.01) + model_.images[1].name + " " +
                 model_.images[4].name + "\n" + Distance(2, 5, 0.01, 2));
  const std::string max_error =
      std::to_string(1.2 * Summarize(PixelErrors(model_)).max);
  const KrotResult result = Succeeded(
      RunKrot({"tolerance_analyzer", "--input_path", folder_ / "input",
               "--ToleranceAnalyzer.max_error", max_error,
               "--ToleranceAnalyzer.distances", folder_ / "bars.txt",
               "--report_path", folder_ / "t.json"}));
  const Json report = ReadJson(folder_ / "t.json");
  EXPECT_TRUE(report["boxes"].empty());
  ASSERT_EQ(report["lengths"].size(), 3u);
  EXPECT_EQ(report["lengths"][0]["is_bar"], true);
  const double metres = (Own(1) - Own(4)).norm();
  EXPECT_LE(report["lengths"][1]["low"]["proved"], metres);
  EXPECT_GE(report["lengths"][1]["high"]["proved"], metres);
  EXPECT_EQ(report["lengths"][2]["is_contradicted"], true);
  EXPECT_THAT(result.out,
              HasSubstr("It is proved that " + model_.images[2].name + " to " +
                        model_.images[5].name + " is not"));
  EXPECT_THAT(result.out, Not(HasSubstr("x from")));
}

TEST_F(Metres, RadiiThatAreUnknownAreTheMedianOfTheOthers) {
  WritePositions("");
  std::ofstream points(folder_ / "points.txt");
  points.precision(17);
  for (size_t k = 0; k < 3; ++k) {
    points << model_.points3D[k].id << ' '
           << (own_from_model_ * model_.points3D[k].xyz).transpose()
           << " 0.2\n";
  }
  points.close();
  const std::string count = std::to_string(model_.images.size());
  const KrotResult result = Succeeded(SolveIn(
      "model", "output", {"--point_positions_path", folder_ / "points.txt"}));
  EXPECT_THAT(
      result.err,
      HasSubstr(count + " of " + std::to_string(model_.images.size() + 3) +
                " positions have no radius or covariance that can be "
                "used: they take the median of the others' radii, "
                "0.2"));
}

TEST_F(Metres, ARadiusThatNoPositionNeedsIsSaidToBeOfNoUse) {
  WritePositions("0.2");
  const Words radius = {"--Problem.position_radius", "3"};
  const std::string sentence = "--Problem.position_radius is not used: ";
  EXPECT_THAT(SolveIn("model", "unused", radius).err, HasSubstr(sentence));
  WritePositions("");
  EXPECT_THAT(SolveIn("model", "used", radius).err, Not(HasSubstr(sentence)));
}

}  // namespace
}  // namespace krot::internal
