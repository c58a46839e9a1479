#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iomanip>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/analysis/pixel_errors.h"
#include "krot/model/model.h"
#include "krot/synthetic/random.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"
#include "tests/end_to_end/script.h"

namespace krot {
namespace {

namespace fs = std::filesystem;

class Scripts : public ::testing::Test {
 protected:
  Scripts() { Save(SmallLegacyModel(), folder_ / "model"); }

  void ExpectRefused(const std::string& name,
                     const std::vector<std::string>& arguments,
                     const std::string& part) const {
    const std::vector<std::string> before = FileNames(folder_.path());
    const ScriptResult result = RunScript(name, arguments);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, IsOneSentence(name, part));
    EXPECT_EQ(result.out, "");
    EXPECT_EQ(FileNames(folder_.path()), before);
  }

  TempFolder folder_;
};

TEST_F(Scripts, SayHowTheyAreUsed) {
  for (const char* name : {"mapper_then_krot.sh", "compare_linf_with_ba.sh",
                           "strecha_to_colmap.sh"}) {
    const ScriptResult result = RunScript(name, {"-h"});
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_THAT(result.out,
                ::testing::HasSubstr("Usage: " + std::string(name)));
    EXPECT_EQ(result.err, "");
  }
}

TEST_F(Scripts, RefuseWhatTheyDoNotUnderstand) {
  for (const char* name : {"mapper_then_krot.sh", "compare_linf_with_ba.sh",
                           "strecha_to_colmap.sh"}) {
    ExpectRefused(name, {}, "is required");
    ExpectRefused(name, {"sparse"}, "'sparse' is not an option");
    ExpectRefused(name, {"--output_path"}, "--output_path needs a value");
  }
  ExpectRefused("compare_linf_with_ba.sh", {"--out", "x"}, "--out is unknown");
}

TEST_F(Scripts, CheckTheirPathsFirst) {
  const std::string model = folder_ / "model";
  const std::string output = folder_ / "output";
  const std::string missing = folder_ / "missing";
  const std::string file = folder_ / "model/images.bin";
  ExpectRefused("compare_linf_with_ba.sh",
                {"--input_path", missing, "--output_path", output},
                "is not a folder");
  ExpectRefused("compare_linf_with_ba.sh",
                {"--input_path", folder_.path(), "--output_path", output},
                "holds no COLMAP model");
  ExpectRefused("compare_linf_with_ba.sh",
                {"--input_path", model, "--output_path", output,
                 "--truth_path=" + missing},
                "--truth_path");
  ExpectRefused("mapper_then_krot.sh",
                {"--database_path", missing, "--image_path", model,
                 "--output_path", output},
                "is not a file");
  ExpectRefused("mapper_then_krot.sh",
                {"--database_path", file, "--image_path", missing,
                 "--output_path", output},
                "is not a folder");
  fs::create_directories(folder_ / "sparse/0");
  ExpectRefused("mapper_then_krot.sh",
                {"--database_path", file, "--image_path", model,
                 "--output_path", folder_ / "sparse"},
                "already holds the model 0");
  ExpectRefused("strecha_to_colmap.sh",
                {"--input_path", model, "--output_path", output},
                "holds no *.camera");
}

TEST_F(Scripts, PassShellcheck) {
  if (std::system("command -v shellcheck >/dev/null 2>&1") != 0) {
    GTEST_SKIP() << "shellcheck is not installed";
  }
  const std::string log = folder_ / "log";
  EXPECT_EQ(std::system(
                ("cd '" KROT_SCRIPTS "' && shellcheck *.sh >'" + log + "' 2>&1")
                    .c_str()),
            0)
      << ReadBytes(log);
}

bool HasColmapAndJq() {
  return HasColmap() && std::system("command -v jq >/dev/null 2>&1") == 0;
}

TEST_F(Scripts, CompareWithTheInputWhereNoTruthIsGiven) {
  if (!HasColmapAndJq()) GTEST_SKIP() << "needs colmap and jq";
  const fs::path output = folder_ / "compared";
  const ScriptResult result =
      RunScript("compare_linf_with_ba.sh", {"--input_path", folder_ / "model",
                                            "--output_path=" + output.string(),
                                            "--max_error_factor", "1.3"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, ::testing::StartsWith("Cameras: against the input"));
  EXPECT_THAT(result.out, ::testing::HasSubstr("bounded, 1.3 x the lowest"));

  // The largest error of a result, recomputed from its files.
  const auto max_error = [&output](const std::string& name) {
    return Summarize(PixelErrors(Load(output / name))).max;
  };
  EXPECT_LE(max_error("bounded"), 1.3 * max_error("linf"));
  for (const char* name : {"colmap_ba", "ba", "cauchy", "ba_rotations"}) {
    EXPECT_LT(max_error("linf"), max_error(name)) << name;
    std::ostringstream number;
    number << std::fixed << std::setprecision(4) << max_error(name);
    EXPECT_THAT(result.out, ::testing::HasSubstr(number.str())) << name;
  }
}

// COLMAP 3.8 aborts at tracks of one observation.
TEST_F(Scripts, SayWhereACommandThatFailedSaysWhy) {
  if (!HasColmapAndJq()) GTEST_SKIP() << "needs colmap and jq";
  Save(WithShortTracks(SmallLegacyModel(), 1), folder_ / "short");
  const fs::path output = folder_ / "compared";
  const ScriptResult result =
      RunScript("compare_linf_with_ba.sh",
                {"--input_path", folder_ / "short", "--output_path", output});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.out, "");
  const std::string log = output / "reports/colmap_ba.log";
  EXPECT_THAT(result.err, ::testing::HasSubstr("failed, as " + log + " says"));
  EXPECT_NE(ReadBytes(log), "");
}

// A camera file of Strecha et al.: K, no distortion, the camera's axes in the
// world as columns, the centre, the size.
std::string CameraFile(const Eigen::Matrix3d& world_from_cam,
                       const Eigen::Vector3d& center,
                       const std::string& distortion = "0 0 0") {
  std::ostringstream text;
  text << std::setprecision(17) << "2700.5 0 1520.25 \n0 2710.5 1006.75 \n"
       << "0 0 1 \n"
       << distortion << "\n"
       << world_from_cam << "\n"
       << center.transpose() << "\n3072 2048\n";
  return text.str();
}

// Rotations by any angle: those near half a turn are where a quaternion's
// scalar part vanishes.
Eigen::Matrix3d TestRotation(int i, Random* random) {
  const Eigen::Vector3d axis = random->GaussianVector().normalized();
  return Eigen::AngleAxisd(i * M_PI / 12, axis).toRotationMatrix();
}

TEST_F(Scripts, TakeSurveyedCamerasToColmap) {
  Random random(3);
  std::vector<Eigen::Matrix3d> rotations;
  std::vector<Eigen::Vector3d> centers;
  for (int i = 0; i < 25; ++i) {
    rotations.push_back(TestRotation(i, &random));
    centers.push_back(10 * random.GaussianVector());
    const std::string name = std::to_string(100 + i) + ".jpg.camera";
    WriteBytes(folder_ / "survey" / name,
               CameraFile(rotations.back(), centers.back()));
  }
  const ScriptResult result = RunScript(
      "strecha_to_colmap.sh",
      {"--input_path", folder_ / "survey", "--output_path", folder_ / "truth"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Model truth = Load(folder_ / "truth");
  ASSERT_EQ(truth.images.size(), rotations.size());
  for (size_t i = 0; i < rotations.size(); ++i) {
    const Image& image = truth.images[i];
    EXPECT_EQ(image.name, std::to_string(100 + i) + ".jpg");
    const Eigen::Matrix3d cam_from_world = image.cam_from_world.Rotation();
    EXPECT_LE((cam_from_world - rotations[i].transpose()).norm(), 1e-12) << i;
    const Eigen::Vector3d center =
        -cam_from_world.transpose() * image.cam_from_world.translation;
    EXPECT_LE((center - centers[i]).norm(), 1e-12 * centers[i].norm()) << i;
    EXPECT_EQ(truth.cameras[i].params,
              (std::vector<double>{2700.5, 2710.5, 1520.25, 1006.75}));
    EXPECT_EQ(truth.cameras[i].width, 3072u);
    EXPECT_EQ(truth.cameras[i].height, 2048u);
  }
}

TEST_F(Scripts, RefuseSurveyedCamerasThatTheyCannotRepresent) {
  const Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  const Eigen::Vector3d center(1, 2, 3);
  int i = 0;
  for (const auto& [file, part] :
       std::vector<std::pair<std::string, std::string>>{
           {CameraFile(turn, center, "0.1 0 0"), "distortion"},
           {CameraFile(1.1 * turn, center), "no rotation"},
           {CameraFile(turn, center) + "5\n", "27 numbers found"},
           {"", "is empty"}}) {
    const fs::path survey = folder_ / ("survey" + std::to_string(++i));
    WriteBytes(survey / "0.jpg.camera", file);
    const fs::path output = folder_ / ("output" + std::to_string(i));
    const ScriptResult result =
        RunScript("strecha_to_colmap.sh",
                  {"--input_path", survey, "--output_path", output});
    EXPECT_NE(result.exit_code, 0);
    EXPECT_THAT(result.err, ::testing::HasSubstr(part));
    EXPECT_FALSE(fs::exists(output));
  }
}

}  // namespace
}  // namespace krot
