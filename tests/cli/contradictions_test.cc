#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "krot/model/contradictions.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

// Models whose tracks and images contradict each other, through every command
// that reads models.

namespace krot {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using Json = nlohmann::json;

class OnContradiction : public ::testing::Test {
 protected:
  OnContradiction() {
    // A 2D point that its track's 3D point shares with another's track, one
    // that was forgotten by its image, one of a 3D point that is gone.
    model_ = SmallLegacyModel();
    TrackElement& shared = model_.track_elements[0];
    shared_point2D(shared).point3D_id = model_.points3D[1].id;
    shared_point2D(model_.track_elements.back()).point3D_id = kInvalidPoint3DId;
    for (Image& image : model_.images) {
      Point2D stray;
      stray.x = 5;
      stray.point3D_id = 999999;
      image.points2D.push_back(stray);
    }
    Save(model_, input_);
  }

  Point2D& shared_point2D(const TrackElement& element) {
    for (Image& image : model_.images) {
      if (image.id == element.image_id) {
        return image.points2D[element.point2D_idx];
      }
    }
    throw std::logic_error("no such image");
  }

  std::vector<std::string> Solve(const std::string& name) const {
    return {"solver",        "--input_path",       input_,
            "--output_path", folder_ / name,       "--report_path",
            report_,         "--certificate_path", folder_ / (name + ".json")};
  }

  Json Report() const { return Json::parse(ReadBytes(report_)); }

  int num_images() const { return static_cast<int>(model_.images.size()); }

  const TempFolder folder_;
  const fs::path input_ = folder_ / "input";
  const fs::path report_ = folder_ / "report.json";
  Model model_;
};

std::vector<std::string> With(std::vector<std::string> arguments,
                              const std::string& on_contradiction) {
  arguments.push_back("--Model.on_contradiction");
  arguments.push_back(on_contradiction);
  return arguments;
}

std::vector<std::string> Check(const fs::path& model,
                               const fs::path& certificate) {
  return {"certificate_checker", "--input_path", model, "--certificate_path",
          certificate};
}

TEST_F(OnContradiction, TheTracksAreFollowedAndBothFilesKept) {
  const KrotResult result = RunKrot(Solve("output"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("contradicts itself: 2 track elements"));
  EXPECT_THAT(result.err, HasSubstr("the tracks are followed"));
  Ignoring ignoring;
  ignoring.translations = ignoring.coordinates = ignoring.point_errors = true;
  EXPECT_THAT(Load(folder_ / "output"), IsModel(model_, ignoring));
  const Json contradictions = Report()["contradictions"];
  EXPECT_EQ(contradictions["track_elements"], 2);
  EXPECT_EQ(contradictions["points2D"], 1 + num_images());
  EXPECT_EQ(Report()["num_observations"], model_.track_elements.size());
  for (const fs::path& model : {input_, folder_ / "output"}) {
    EXPECT_EQ(RunKrot(Check(model, folder_ / "output.json")).exit_code, 0);
  }
}

TEST_F(OnContradiction, TheImagesAreFollowedWhereAskedAndAgreeAfterwards) {
  const KrotResult result = RunKrot(With(Solve("output"), "follow_images"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("the images are followed"));
  EXPECT_FALSE(FindContradictions(Load(folder_ / "output")).Any());
  const fs::path certificate = folder_ / "output.json";
  EXPECT_EQ(RunKrot(Check(folder_ / "output", certificate)).exit_code, 0);
  EXPECT_EQ(
      RunKrot(With(Check(input_, certificate), "follow_images")).exit_code, 0);
  EXPECT_EQ(RunKrot(Check(input_, certificate)).exit_code, 4);
}

TEST_F(OnContradiction, EveryCommandRefusesWhereAsked) {
  WriteBytes(folder_ / "certificate.json",
             R"({"version": 1, "norm": "inf", "lower_bound": 1, "defect": 0,
                 "model_sha256": "", "observations": []})");
  const std::vector<std::vector<std::string>> commands = {
      Solve("output"),
      {"point_triangulator", "--input_path", input_, "--output_path",
       folder_ / "output"},
      {"bundle_adjuster", "--input_path", input_, "--output_path",
       folder_ / "output"},
      {"model_analyzer", "--path", input_},
      {"model_comparer", "--input_path1", input_, "--input_path2", input_},
      Check(input_, folder_ / "certificate.json"),
  };
  for (const std::vector<std::string>& command : commands) {
    const KrotResult result = RunKrot(With(command, "refuse"));
    EXPECT_EQ(result.exit_code, 2) << command[0];
    EXPECT_THAT(result.err, IsOneSentence("krot " + command[0],
                                          "in its track, but that 2D point "
                                          "names"));
    EXPECT_FALSE(fs::exists(folder_ / "output"));
  }
}

TEST_F(OnContradiction, EveryOtherCommandReadsAndCounts) {
  const std::vector<std::vector<std::string>> commands = {
      {"point_triangulator", "--input_path", input_, "--output_path",
       folder_ / "points"},
      {"bundle_adjuster", "--input_path", input_, "--output_path",
       folder_ / "adjusted"},
      {"model_analyzer", "--path", input_},
      {"model_comparer", "--input_path1", input_, "--input_path2", input_,
       "--overlay_path", folder_ / "overlay"},
  };
  for (std::vector<std::string> command : commands) {
    command.insert(command.end(), {"--report_path", report_});
    const KrotResult result = RunKrot(command);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.err, HasSubstr("contradicts itself")) << command[0];
    Json contradictions = Report()["contradictions"];
    if (command[0] == "model_comparer") {
      EXPECT_EQ(contradictions["model1"], contradictions["model2"]);
      contradictions = contradictions["model1"];
      EXPECT_EQ(Report()["num_observations"]["shared"],
                model_.track_elements.size());
    }
    EXPECT_EQ(contradictions["track_elements"], 2) << command[0];
    fs::remove(report_);
  }
  // Nothing that is gone comes back as a point of the other model.
  EXPECT_EQ(FindContradictions(Load(folder_ / "overlay")).num_points2D, 2);
}

TEST_F(OnContradiction, A2DPointInTwoTracksIsAnObservationOfBoth) {
  Model model = SmallLegacyModel();
  // The last track ends with the first one's first 2D point, too.
  model.track_elements.push_back(model.track_elements.front());
  ++model.points3D.back().track_end;
  Save(model, folder_ / "twice");
  const KrotResult result =
      RunKrot({"model_comparer", "--input_path1", folder_ / "twice",
               "--input_path2", folder_ / "twice", "--report_path", report_});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(Report()["num_observations"]["shared"],
            model.track_elements.size());
  EXPECT_EQ(Report()["num_points"]["shared"], model.points3D.size());
}

}  // namespace
}  // namespace krot
