#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model/image_geometry.h"
#include "tests/cli/known_fixture.h"
#include "tests/cli/scenes.h"

namespace krot {
namespace {

using ::testing::HasSubstr;

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
  std::vector<std::string> Options(std::vector<std::string> more = {
                                       "--overwrite", "1"}) const {
    more.insert(more.end(), {"--positions_path", folder_ / "positions.txt"});
    return more;
  }

  static constexpr size_t kWrong = 2;
  const Model model_ = SmallLegacyModel();
};

TEST_F(KnownPositions, AreKeptAndProved) {
  constexpr double kRadius = 1e-3;
  WritePositions(kRadius, 5 * kRadius);
  const KrotResult result = Solve("input", "output", Options());
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("with these positions, no translations"));
  EXPECT_THAT(result.out, HasSubstr("Known positions that hold cameras"));
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
  const KrotResult check = Check("output", "output");
  EXPECT_EQ(check.exit_code, 0) << check.err;
  EXPECT_THAT(check.out, HasSubstr("to be within the radii below"));
}

TEST_F(KnownPositions, ThatCannotBeKeptAreNamedAndRefuted) {
  WritePositions(1e-3, 0.5);
  const KrotResult result = Solve("input", "output", Options());
  EXPECT_EQ(result.exit_code, 7);
  EXPECT_THAT(result.err, HasSubstr("in conflict are the positions of "));
  EXPECT_THAT(result.err, HasSubstr(model_.images[kWrong].name));
  const KrotResult check = Check("input", "output");
  EXPECT_EQ(check.exit_code, 0) << check.err;
}

TEST_F(KnownPositions, ThatCannotBeMeantAreRefused) {
  const std::string name = model_.images[0].name;
  const auto solve = [&](const std::string& text) {
    std::ofstream(folder_ / "positions.txt") << text;
    return Solve("input", "output", Options());
  };
  for (const auto& [text, part] :
       std::vector<std::pair<std::string, std::string>>{
           {"nobody.jpg 1 2 3 4\n", "positions.txt:1: found \"nobody.jpg\""},
           {"# a\n" + name + " 1 2 3 0\n", "positions.txt:2: found \"0\""},
           {name + " 1 2 3 -1\n", "a radius above zero"},
           {name + " 1 2 x 1\n", "found \"x\""},
           {name + " 1 2 inf 1\n", "found \"inf\""},
           {"1 2 3 4\n", "found no name"},
           {name + "\n", "X, Y, Z, RADIUS"},
           {name + " 1 2 3 4\n" + name + " 1 2 3 4\n", "line 1 names it"},
           {"\n", "found no position"}}) {
    SCOPED_TRACE(text);
    const KrotResult result = solve(text);
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.err, IsOneSentence("krot solver", part));
  }
  WritePositions(1, 0);
  for (const std::vector<std::string>& options :
       std::vector<std::vector<std::string>>{{"--Solver.max_error", "3"},
                                             {"--Solver.norm", "1"},
                                             {"--Solver.polish", "full"},
                                             {"--Solver.finish", "sweeps"}}) {
    const KrotResult result = Solve("input", "output", Options(options));
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, HasSubstr("--positions_path has no effect"));
  }
}

}  // namespace
}  // namespace krot
