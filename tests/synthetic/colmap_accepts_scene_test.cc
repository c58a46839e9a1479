#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model/model_io.h"
#include "krot/synthetic/scene.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// COLMAP's own tools as the judge of what we write; skipped where it is not
// installed.
class ColmapAcceptsScene : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v colmap > /dev/null") != 0) {
      GTEST_SKIP() << "colmap is not installed";
    }
    folder_ = fs::path(testing::TempDir()) /
              testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }

  void TearDown() override {
    if (!folder_.empty()) fs::remove_all(folder_);
  }

  // Runs `colmap arguments` and returns what it printed; fails the test if
  // it does not end with 0.
  std::string RunColmap(const std::string& arguments) const {
    const fs::path log = folder_ / "log.txt";
    const std::string command = "QT_QPA_PLATFORM=offscreen colmap " +
                                arguments + " > '" + log.string() + "' 2>&1";
    const int status = std::system(command.c_str());
    std::ifstream stream(log);
    std::stringstream text;
    text << stream.rdbuf();
    EXPECT_EQ(status, 0) << command << "\n" << text.str();
    return text.str();
  }

  std::string Quoted(const char* name) const {
    return "'" + (folder_ / name).string() + "'";
  }

  fs::path folder_;
};

TEST_F(ColmapAcceptsScene, WithEveryCameraModelThatDebiansColmapKnows) {
  for (int camera_model_id = 0; camera_model_id <= 10; ++camera_model_id) {
    SceneOptions options;
    options.camera_model_id = camera_model_id;
    options.has_rigs = camera_model_id % 2 == 0;
    options.num_points = 100;
    WriteModelOptions write_options;
    write_options.overwrite = true;
    WriteModel(SynthesizeScene(options).model, folder_ / "scene",
               write_options);
    const std::string analysis =
        RunColmap("model_analyzer --path " + Quoted("scene"));
    EXPECT_THAT(analysis, HasSubstr("Registered images: 20"));
    EXPECT_THAT(analysis, HasSubstr("Points: 100"));
  }
}

// point_filtering recomputes every error with COLMAP's own cameras.
TEST_F(ColmapAcceptsScene, AndFindsNoReprojectionErrorInTheTruth) {
  SceneOptions options;
  options.camera_model_id = 4;
  options.sensors_per_rig = 2;
  WriteModel(SynthesizeScene(options).ground_truth, folder_ / "scene", {});
  fs::create_directories(folder_ / "filtered");
  RunColmap("point_filtering --input_path " + Quoted("scene") +
            " --output_path " + Quoted("filtered") +
            " --max_reproj_error 1e6 --min_tri_angle 0");
  const std::string analysis =
      RunColmap("model_analyzer --path " + Quoted("filtered"));
  EXPECT_THAT(analysis, HasSubstr("Points: 1000"));
  EXPECT_THAT(analysis, HasSubstr("Mean reprojection error: 0.000000px"));
}

TEST_F(ColmapAcceptsScene, AndConvertsItToText) {
  WriteModel(SynthesizeScene({}).model, folder_ / "scene", {});
  fs::create_directories(folder_ / "text");
  RunColmap("model_converter --input_path " + Quoted("scene") +
            " --output_path " + Quoted("text") + " --output_type TXT");
  const Model text = ReadModel(folder_ / "text", ModelFormat::kText);
  EXPECT_EQ(text.points3D.size(), 1000u);
}

}  // namespace
}  // namespace krot::internal
