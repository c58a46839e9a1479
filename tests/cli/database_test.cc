#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"
#include "tests/testing/database_writer.h"

namespace krot {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

class DatabaseOption : public ::testing::Test {
 protected:
  DatabaseOption() {
    SceneOptions options;
    options.num_frames = 8;
    options.num_points = 600;
    options.pixel_noise = 0.5;
    Model model = SynthesizeScene(options).ground_truth;
    Save(model, folder_ / "sound");
    {
      DatabaseWriter writer(folder_ / "database.db", true);
      const Database database = DatabaseOf(model);
      for (size_t i = 0; i < model.images.size(); ++i) {
        writer.AddImage(static_cast<int64_t>(i + 1), model.images[i].name,
                        database.keypoints[i]);
      }
      for (const VerifiedPair& pair : database.pairs) {
        writer.AddPair(pair.image1 + 1, pair.image2 + 1, pair.matches);
      }
    }
    Pose& pose = model.frames[2].rig_from_world;
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(0.03, Eigen::Vector3d(1, 2, 2) / 3).matrix();
    pose = ToPose({turn * pose.Rotation(), turn * pose.translation});
    Save(model, folder_ / "turned");
  }

  KrotResult Analyze(const std::string& model) const {
    return RunKrot({"model_analyzer", "--path", folder_ / model,
                    "--database_path", folder_ / "database.db", "--report_path",
                    folder_ / "r.json"});
  }

  TempFolder folder_;
};

TEST_F(DatabaseOption, HoldsMatchesAgainstPoses) {
  const std::string bytes = ReadBytes(folder_ / "database.db");
  KrotResult result = Analyze("sound");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("By the matches none of "));
  EXPECT_EQ(ReadBytes(folder_ / "database.db"), bytes);
  result = Analyze("turned");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("1 image is wrong."));
  EXPECT_THAT(result.out, HasSubstr("rotation: turned by 1.7"));
  const Json json = Json::parse(ReadBytes(folder_ / "r.json"))["database"];
  EXPECT_EQ(json["cheapest"]["images"].size(), 1);
  EXPECT_TRUE(json["images"][2]["is_wrong"]);
  EXPECT_EQ(json["images"][2]["fault"], "rotation");
  EXPECT_NEAR(json["images"][2]["turned_by_deg"].get<double>(), 1.719, 0.05);
  EXPECT_THAT(result.out, HasSubstr(json["verdict"].get<std::string>()));
}

TEST_F(DatabaseOption, IsRefusedWithCode2IfItCannotBeRead) {
  WriteBytes(folder_ / "database.db", "no database");
  const KrotResult result = Analyze("sound");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err,
              IsOneSentence("krot model_analyzer", "is no SQLite database"));
}

}  // namespace
}  // namespace krot
