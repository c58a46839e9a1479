#include <algorithm>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model/rigs.h"
#include "tests/cli/known_fixture.h"
#include "tests/cli/scenes.h"

namespace krot::internal {
namespace {

// Where the images of SmallLegacyModel are known to be.
class KnownPositions : public Known {
 protected:
  void SetUp() override { Save(model_, folder_ / "input"); }

  Eigen::Vector3d CentreOf(const Model& model, size_t image) const {
    return Center(ImageGeometries(model)[image].cam_from_world);
  }
  // All around the model's own; one `off` from there.
  void WritePositions(double radius, double off) const {
    std::ofstream file(folder_ / "positions.txt");
    file.precision(17);
    file << "# by name\n\n";
    for (size_t n = 0; n < model_.images.size(); ++n) {
      Eigen::Vector3d xyz = CentreOf(model_, n);
      if (n == kWrong) xyz.x() += off;
      file << model_.images[n].name << ' ' << xyz.transpose() << ' ' << radius
           << '\n';
    }
  }
  Words Options(Words more = {"--overwrite", "1"}) const {
    return more + Words{"--positions_path", folder_ / "positions.txt"};
  }

  static constexpr size_t kWrong = 2;
  const Model model_ = SmallLegacyModel();
};

TEST_F(KnownPositions, AreKeptAndProved) {
  constexpr double kRadius = 1e-3;
  WritePositions(kRadius, 5 * kRadius);
  const KrotResult result = Succeeded(Solve("input", "output", Options()));
  EXPECT_THAT(result.out, HasSubstr("with these positions, no translations"));
  EXPECT_THAT(result.out, HasSubstr("Known positions that hold against"));
  const Json report = Report("output");
  EXPECT_EQ(report["termination"], "gap_reached");
  EXPECT_EQ(report["positions"]["num_known"], model_.images.size());
  EXPECT_LE(report["positions"]["largest_ratio"], 1 + 1e-6);
  EXPECT_FALSE(report["support_positions"].empty());
  const Model after = Load(folder_ / "output");
  for (size_t n = 0; n < model_.images.size(); ++n) {
    Eigen::Vector3d xyz = CentreOf(model_, n);
    if (n == kWrong) xyz.x() += 5 * kRadius;
    EXPECT_LE((CentreOf(after, n) - xyz).norm(), (1 + 1e-6) * kRadius);
  }
  const KrotResult check = Succeeded(Check("output", "output"));
  EXPECT_THAT(check.out, HasSubstr("to be kept to the radii below"));
}

TEST_F(KnownPositions, OfPointsAndWithAxesAreKeptAndProved) {
  WritePositions(1e-3, 0);
  std::ofstream points(folder_ / "points.txt");
  points.precision(17);
  const std::vector<Point3D>& own = model_.points3D;
  points << own[0].id << ' ' << own[0].xyz.transpose() << " .001\n"
         << own[1].id << ' ' << own[1].xyz.transpose() << " .001 .002 .003\n"
         << own[2].id << ' ' << own[2].xyz.transpose()
         << " .001 .002 .003 1 0 0 .5\n";
  points.close();
  Succeeded(Solve("input", "output",
                  Options({"--point_positions_path", folder_ / "points.txt"})));
  EXPECT_EQ(Report("output")["positions"]["num_known"],
            model_.images.size() + 3);
  const Model after = Load(folder_ / "output");
  EXPECT_LE((after.points3D[0].xyz - own[0].xyz).norm(), (1 + 1e-6) * 1e-3);
  Succeeded(Check("output", "output"));
}

// As other programs write them, of photos that were not all registered.
TEST_F(KnownPositions, OfOtherProgramsAreTheSame) {
  WritePositions(1e-3, 5e-3);
  Succeeded(Solve("input", "expected", Options()));
  std::istringstream lines(ReadBytes(folder_ / "positions.txt"));
  std::string text =
      "\xef\xbb\xbfphoto,x,y,z\r\nE:\\photos\\lost.jpg,1,2,3\r\n";
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    line.resize(line.find_last_of(' '));  // the radius
    std::replace(line.begin(), line.end(), ' ', ',');
    text += "E:\\photos\\" + line + "\r\n";
  }
  WriteBytes(folder_ / "positions.txt", text);
  const KrotResult result = Succeeded(
      Solve("input", "output", Options({"--Problem.position_radius", "1e-3"})));
  EXPECT_THAT(result.err, HasSubstr("warning: "));
  EXPECT_THAT(result.err, HasSubstr("skipped 1 of " +
                                    std::to_string(model_.images.size() + 1) +
                                    " lines, whose image the model does not "
                                    "have; the first has image "
                                    "\"E:\\photos\\lost.jpg\""));
  EXPECT_THAT(Load(folder_ / "output"), IsModel(Load(folder_ / "expected")));
}

TEST_F(KnownPositions, AreInflatedByTheSmallestFactorThatIsEnough) {
  WritePositions(1e-3, 5e-3);
  Succeeded(Solve("input", "given", Options()));
  const double bound = Report("given")["lower_bound"];
  const KrotResult result = Succeeded(
      Solve("input", "output",
            Options({"--Problem.inflate_positions", std::to_string(0.9 * bound),
                     "--factor_certificate_path", folder_ / "factor.json"})));
  EXPECT_THAT(result.out, HasSubstr("All radii are multiplied by "));
  const Json factor = Report("output")["positions"]["factor"];
  EXPECT_GT(factor["lower_bound"], 1);
  EXPECT_LE(factor["value"], 1.01 * factor["lower_bound"].get<double>());
  EXPECT_LE(Report("output")["cost_final"], 0.9 * bound + 1e-6);
  Succeeded(RunKrot({"certificate_checker", "--input_path", folder_ / "input",
                     "--certificate_path", folder_ / "factor.json"}));

  const KrotResult refused = Solve(
      "input", "refused", Options({"--Problem.inflate_positions", "1e-3"}));
  EXPECT_EQ(refused.exit_code, 7);
  EXPECT_THAT(refused.err, HasSubstr("a million times as large"));
}

TEST_F(KnownPositions, ThatCannotBeKeptAreNamedAndRefuted) {
  WritePositions(1e-3, 0.5);
  const KrotResult result = Solve("input", "output", Options());
  EXPECT_EQ(result.exit_code, 7);
  EXPECT_THAT(result.err, HasSubstr("in conflict are the positions of "));
  EXPECT_THAT(result.err, HasSubstr(model_.images[kWrong].name));
  Succeeded(Check("input", "output"));
}

TEST_F(KnownPositions, OfWhatMustNotMoveAreCheckedAndCounted) {
  const std::string& name = model_.images[kWrong].name;
  std::ofstream(folder_ / "fixed.txt") << name << '\n';
  const Words fixed = {"--fixed_images_path", folder_ / "fixed.txt"};
  WritePositions(1e-3, 0.5e-3);
  Succeeded(Solve("input", "output", Options(fixed)));
  EXPECT_EQ(Report("output")["positions"]["num_known"], model_.images.size());
  EXPECT_NEAR(Report("output")["positions"]["largest_ratio"], 1, 0.5);
  WritePositions(1e-3, 5e-3);
  for (const std::string command : {"solver", "bundle_adjuster"}) {
    EXPECT_THAT(
        RunKrot({command, "--input_path", folder_ / "input", "--output_path",
                 folder_ / "refused"},
                Options(fixed)),
        IsRefused(2, "krot " + command, "found " + name + " fixed at "));
  }
  const std::string id = std::to_string(model_.points3D[1].id);
  std::ofstream(folder_ / "fixed.txt") << id << '\n';
  std::ofstream(folder_ / "points.txt") << id << " 100 100 100 0.1\n";
  EXPECT_THAT(
      Solve("input", "refused",
            {"--fixed_points_path", folder_ / "fixed.txt",
             "--point_positions_path", folder_ / "points.txt"}),
      IsRefused(2, "krot solver", "within the radius around 100 100 100, its"));
  // Both images of a frame.
  const Model rig = SmallRigModel(2);
  Save(rig, folder_ / "rig");
  const ImageId first = rig.images[0].id;
  const std::vector<ImageGeometry> geometries = ImageGeometries(rig);
  for (size_t n = 1; n < rig.images.size(); ++n) {
    if (geometries[n].frame != geometries[0].frame) continue;
    std::ofstream(folder_ / "fixed.txt") << first << '\n';
    std::ofstream(folder_ / "positions.txt")
        << rig.images[n].name << " 100 100 100 0.1\n";
  }
  EXPECT_THAT(
      Solve("rig", "refused", Options(fixed)),
      IsRefused(2, "krot solver", "within the radius around 100 100 100, its"));
}

TEST_F(KnownPositions, ThatCannotBeMeantAreRefused) {
  const std::string name = model_.images[0].name;
  const auto solve = [&](const std::string& text) {
    std::ofstream(folder_ / "positions.txt") << text;
    return Solve("input", "output", Options());
  };
  for (const auto& [text, part] :
       std::vector<std::pair<std::string, std::string>>{
           {"nobody.jpg 1 2 3 4\n",
            "found no image of the model in its 1 line"},
           {"# a\n" + name + " 1 2 3 0\n", "positions.txt:2: found \"0\""},
           {name + " 1 2 3 -1\n", "a radius above zero"},
           {name + " 1 2 3 1 1 0\n", "a radius above zero"},
           {name + " 1 2 3 1 1 1e5\n", "10,000 times another"},
           {name + " 1 2 3 1 2 3 0 0 0 0\n", "a quaternion that is not zero"},
           {name + " 1 2 x 1\n", "found \"x\""},
           {name + " 1 2 inf 1\n", "found \"inf\""},
           {"1 2 3 4\n", "found no name"},
           {name + "\n", "X Y Z RADIUS"},
           {name + " 1 2 3\n", "--Problem.position_radius"},
           {name + " 1 2 3 4\n" + name + " 1 2 3 4\n", "line 1 names it"},
           {"\n", "found no line"}}) {
    SCOPED_TRACE(text);
    EXPECT_THAT(solve(text), IsRefused(2, "krot solver", part));
  }
  for (const auto& [text, part] :
       std::vector<std::pair<std::string, std::string>>{
           {"99999 1 2 3 4\n", "found no 3D point of the model"},
           {"a 1 2 3 4\n", "the first has 3D point a"},
           {"1 1 2 3\n", "found no RADIUS behind X Y Z"},
           {"1 1 2 3 4 5\n", "found 5 numbers behind 3D point 1"},
           {"1 1 2 3 4\n1 1 2 3 4\n", "line 1 names it"},
           {"", "found no line"}}) {
    SCOPED_TRACE(text);
    std::ofstream(folder_ / "points.txt") << text;
    EXPECT_THAT(Solve("input", "output",
                      {"--point_positions_path", folder_ / "points.txt"}),
                IsRefused(2, "krot solver", part));
  }
  const KrotResult none =
      Solve("input", "output", {"--Problem.inflate_positions", "1"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, HasSubstr("--Problem.inflate_positions has no effect"));
  const KrotResult no_list =
      Solve("input", "output", {"--Problem.position_radius", "1"});
  EXPECT_EQ(no_list.exit_code, 1);
  EXPECT_THAT(no_list.err,
              HasSubstr("--Problem.position_radius has no effect"));
  WritePositions(1, 0);
  for (const Words& options : std::vector<Words>{{"--Solver.max_error", "3"},
                                                 {"--Solver.norm", "1"},
                                                 {"--Solver.polish", "full"}}) {
    const KrotResult result = Solve("input", "output", Options(options));
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, HasSubstr("--positions_path has no effect"));
  }
}

}  // namespace
}  // namespace krot::internal
