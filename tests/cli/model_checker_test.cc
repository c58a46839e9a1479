#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/model.h"
#include "krot/model/rigs.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"
#include "tests/testing/edit_model.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::ElementsAre;
using ::testing::StartsWith;
using ::testing::UnorderedElementsAreArray;

class ModelCheckerCommand : public ::testing::Test {
 protected:
  ModelCheckerCommand() {
    SceneOptions options = SceneOf(8, 400, 6, 0.5, 3);
    Model model = SynthesizeScene(options).ground_truth;
    Save(model, folder_ / "sound");
    Pose& pose = model.frames[2].rig_from_world;
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(0.03, Eigen::Vector3d(1, 2, 2) / 3).matrix();
    pose = ToPose({turn * pose.Rotation(), turn * pose.translation});
    model.images[0].points2D[0].x += 40;
    Save(model, folder_ / "faulty");
  }

  KrotResult Check(const std::string& model, const Words& more = {}) const {
    return RunKrot({"model_checker", "--input_path", folder_ / model}, more);
  }

  // krot's own commands of a table's last part; their names.
  Words RunWhatIsNext(const std::string& table) const {
    std::istringstream lines(table);
    Words commands;
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("    krot ", 0) != 0) continue;
      Words arguments;
      std::istringstream words(line.substr(9));
      for (std::string word; words >> word;) {
        const bool is_folder = word == "CURED" || word == "ADJUSTED";
        arguments.push_back(is_folder ? (folder_ / word).string() : word);
      }
      Succeeded(RunKrot(arguments));
      commands.push_back(arguments[0]);
    }
    return commands;
  }

  TempFolder folder_;
};

TEST_F(ModelCheckerCommand, SaysFirstThatNothingIsWrong) {
  const KrotResult result = Succeeded(Check("sound", {"--fail_on", "wrong"}));
  EXPECT_THAT(result.out, StartsWith("Nothing is wrong: all "));
}

// The inverse poses, in OpenGL's axes, as programs for radiance fields have.
TEST_F(ModelCheckerCommand, ConvertsAModelThatIsNotInColmapsConventions) {
  Model model = Load(folder_ / "sound");
  for (Frame& frame : model.frames) {
    RigidTransform inverse = Inverse(frame.rig_from_world.Transform());
    inverse.rotation.rightCols<2>() *= -1;
    frame.rig_from_world = ToPose(inverse);
  }
  for (size_t n = 0; n < model.images.size(); ++n) {
    model.images[n].cam_from_world = model.frames[n].rig_from_world;
  }
  Save(model, folder_ / "gl");
  const KrotResult result = Succeeded(
      Check("gl", {"--output_path", folder_ / "cured", "--report_path",
                   folder_ / "r.json", "--html_path", folder_ / "r.html"}));
  EXPECT_THAT(
      result.out,
      StartsWith("The model is not in COLMAP's conventions, but has "
                 "poses from camera to world, camera axes (x right, y "
                 "up, z backward): converted, its median error falls "));
  EXPECT_THAT(result.out,
              HasSubstr("Once that is put right: nothing is wrong: all "));
  const Json report = ReadJson(folder_ / "r.json");
  EXPECT_TRUE(report["is_anything_wrong"]);
  EXPECT_EQ(report["conventions"]["camera_axes"], "x right, y up, z backward");
  EXPECT_EQ(report["conventions"]["pixel_axes"], "x right, y down");
  const PixelErrorStatistics errors =
      Summarize(PixelErrors(Load(folder_ / "cured")));
  const double sound = Summarize(PixelErrors(Load(folder_ / "sound"))).max;
  EXPECT_NEAR(errors.max, sound, 1e-6);

  const KrotResult solved =
      RunKrot({"solver", "--input_path", folder_ / "gl", "--output_path",
               folder_ / "solved", "--Solver.method", "res_int"});
  EXPECT_THAT(solved.err,
              HasSubstr("is not in COLMAP's conventions, but has poses"));
}

TEST_F(ModelCheckerCommand, PutsIntrinsicsRightThatAllImagesAskFor) {
  Model model = Load(folder_ / "sound");
  model.cameras[0].params[1] += 20;
  Save(model, folder_ / "shifted");
  const KrotResult result =
      Succeeded(Check("shifted", {"--output_path", folder_ / "cured",
                                  "--report_path", folder_ / "r.json"}));
  EXPECT_THAT(result.out,
              StartsWith("Camera 1 is wrong: its 8 images ask for the "
                         "principal point ("));
  EXPECT_THAT(result.out,
              HasSubstr(" px. Once that is put right: nothing is wrong: all "));
  const Json map = ReadJson(folder_ / "r.json")["conventions"]["pixel_maps"][0];
  EXPECT_EQ(map["images"].size(), 8u);
  EXPECT_NEAR(map["cameras"][0]["params"][1], model.cameras[0].params[1] - 20,
              1);
  Succeeded(Check("cured", {"--fail_on", "wrong"}));
}

TEST_F(ModelCheckerCommand, Puts2DPointsOfOtherPhotosRight) {
  Model model = Load(folder_ / "sound");
  for (const size_t n : {0, 2, 4}) {
    for (Point2D& point : model.images[n].points2D) {
      point.x /= 2;
      point.y /= 2;
    }
  }
  Save(model, folder_ / "half");
  const KrotResult result =
      Succeeded(Check("half", {"--output_path", folder_ / "cured"}));
  EXPECT_THAT(result.out,
              StartsWith("The 2D points of 3 images (" + model.images[0].name +
                         ", ...) are not those of their photos, but 0.5"));
  Succeeded(Check("cured", {"--fail_on", "wrong"}));
}

TEST_F(ModelCheckerCommand, NamesWhatIsWrongAndWritesTheModelWithout) {
  const KrotResult result = Succeeded(
      Check("faulty", {"--output_path", folder_ / "cured", "--report_path",
                       folder_ / "r.json", "--html_path", folder_ / "r.html"}));
  EXPECT_THAT(result.out, StartsWith("1 of 8 images ("));
  EXPECT_THAT(result.out, HasSubstr("colmap image_registrator"));
  const Json report = ReadJson(folder_ / "r.json");
  EXPECT_TRUE(report["is_anything_wrong"]);
  EXPECT_THAT(result.out, StartsWith(report["verdict"].get<std::string>()));
  EXPECT_EQ(report["images"][2]["verdict"], "wrong");
  EXPECT_EQ(report["num_wrong_images"], 1);
  const Model cured = Load(folder_ / "cured");
  ValidateModel(cured);
  EXPECT_EQ(cured.images.size(), 7u);
  Succeeded(Check("cured", {"--fail_on", "wrong"}));
}

TEST_F(ModelCheckerCommand, JudgesNoImageWithoutAPose) {
  Model model = Load(folder_ / "sound");
  Image& image = model.images.emplace_back();
  image.id = 99;
  image.camera_id = model.cameras[0].id;
  image.name = "unregistered.jpg";
  image.cam_from_world.translation.setConstant(NAN);
  UseTrivialRigs(&model);
  Save(model, folder_ / "more");
  const KrotResult result = Succeeded(Check(
      "more", {"--fail_on", "wrong", "--report_path", folder_ / "r.json"}));
  EXPECT_THAT(result.out, StartsWith("Nothing is wrong: all "));
  const Json checked = ReadJson(folder_ / "r.json")["images"].back();
  EXPECT_EQ(checked["image_name"], "unregistered.jpg");
  EXPECT_EQ(checked["verdict"], "fine");
  EXPECT_EQ(checked["center_sigma"], nullptr);
}

TEST_F(ModelCheckerCommand, SaysThatAnImageWithout2DPointsIsNotJudged) {
  Model model = Load(folder_ / "sound");
  Image view = model.images[0];
  view.id = 99;
  view.name = "novel.jpg";
  view.points2D.clear();
  view.cam_from_world.translation.x() += 3;
  model.images.push_back(view);
  UseTrivialRigs(&model);
  Save(model, folder_ / "novel");
  const KrotResult result = Succeeded(
      Check("novel", {"--fail_on", "wrong", "--report_path", folder_ / "r.json",
                      "--output_path", folder_ / "cured"}));
  EXPECT_THAT(result.out, StartsWith("Nothing is wrong: all "));
  EXPECT_THAT(result.out, HasSubstr(" of 8 images agree within "));
  EXPECT_THAT(result.out, HasSubstr("; 1 image is not judged.\n"));
  EXPECT_THAT(result.out, HasSubstr("1 image has no 2D points: its pose cannot "
                                    "be checked (novel.jpg).\n"));
  const Json report = ReadJson(folder_ / "r.json");
  EXPECT_EQ(report["num_images_not_judged"], 1);
  EXPECT_EQ(report["images"][8]["verdict"], "not judged");
  EXPECT_EQ(report["images"][8]["reason"],
            "has no 2D points: its pose cannot be checked");
  EXPECT_EQ(Load(folder_ / "cured").images.size(), 9u);
}

TEST_F(ModelCheckerCommand, RefusesAModelWhoseWriterHadNo2DPoints) {
  Model model = Load(folder_ / "sound");
  for (Image& image : model.images) {
    for (Point2D& point : image.points2D) point.x = point.y = 0;
  }
  Save(model, folder_ / "empty");
  const KrotResult result = Check("empty");
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.err, HasSubstr("in each image all 2D points are at one "));
}

// The tails of the sample's errors are heavier than Gaussian ones.
TEST_F(ModelCheckerCommand, SaysWhatToRunNextAndThatRuns) {
  const KrotResult result =
      Succeeded(RunKrot({"model_checker", "--input_path", KROT_SAMPLE "/model",
                         "--report_path", folder_ / "r.json"}));
  EXPECT_GT(ReadJson(folder_ / "r.json")["cauchy_scale_px"], 0);
  EXPECT_THAT(RunWhatIsNext(result.out),
              ElementsAre("model_checker", "bundle_adjuster"));
}

// Which has only one thing to do.
TEST_F(ModelCheckerCommand, BeginsNoListOfStepsWithThen) {
  const KrotResult result =
      Succeeded(RunKrot({"model_checker", "--input_path", KROT_SAMPLE "/model",
                         "--output_path", folder_ / "cured"}));
  EXPECT_THAT(result.out, HasSubstr("\nNext\n  Adjust all that is left"));
}

// COLMAP passes over pairs that a database has matched already.
TEST_F(ModelCheckerCommand, HasPairsMatchedAnewInACopyWithoutMatches) {
  const Model model = Load(folder_ / "sound");
  const Image& weak = model.images[7];
  const auto from_first = [&](const Point2D& point) {
    return std::hypot(point.x - weak.points2D[0].x,
                      point.y - weak.points2D[0].y);
  };
  std::vector<double> distances;
  for (const Point2D& point : weak.points2D) {
    distances.push_back(from_first(point));
  }
  std::sort(distances.begin(), distances.end());
  Save(Without(model,
               [&](uint64_t e) {
                 const TrackElement& element = model.track_elements[e];
                 return element.image_id == weak.id &&
                        from_first(weak.points2D[element.point2D_idx]) >
                            distances[16];
               }),
       folder_ / "weak");
  const KrotResult result =
      Succeeded(Check("weak", {"--image_path", folder_ / "photos",
                               "--html_path", folder_ / "r.html"}));
  EXPECT_THAT(result.out, HasSubstr("colmap database_cleaner --type matches "
                                    "--database_path MATCHED_DATABASE\n"));
  EXPECT_THAT(result.out, HasSubstr("colmap exhaustive_matcher --database_path "
                                    "MATCHED_DATABASE --SiftMatching.guided"));
  EXPECT_THAT(result.out, HasSubstr("--FeatureMatching.guided_matching"));
  EXPECT_THAT(result.out, HasSubstr("--database_path MATCHED_DATABASE "
                                    "--image_path " +
                                    (folder_ / "photos").string() + " "));
}

// As least squares leave the poses where observations are grossly wrong.
TEST_F(ModelCheckerCommand, HasAModelThatIsNotAdjustedAdjustedFirst) {
  Model model = Load(folder_ / "sound");
  double shift = 0.05;
  for (Frame& frame : model.frames) {
    frame.rig_from_world.translation.x() += shift;
    shift = -shift;
  }
  Save(model, folder_ / "bent");
  const KrotResult result = Succeeded(Check("bent"));
  EXPECT_THAT(result.out, StartsWith("The model is not adjusted, so "));
  EXPECT_THAT(RunWhatIsNext(result.out),
              ElementsAre("bundle_adjuster", "model_checker"));
  EXPECT_THAT(Check("ADJUSTED").out, StartsWith("Nothing is wrong: all "));
}

// A model that was adjusted with its cameras held, though one of them is wrong.
class WrongCameraCommand : public ModelCheckerCommand {
 protected:
  static Model Scene(int sensors_per_rig) {
    SceneOptions options;
    options.num_frames = 20;
    options.num_points = 1000;
    options.pixel_noise = 1;
    options.sensors_per_rig = sensors_per_rig;
    options.has_rigs = sensors_per_rig > 1;
    return SynthesizeScene(options).ground_truth;
  }

  // Every other image has a camera of the same values, 2.
  static Model TwoCameras() {
    Model model = Scene(1);
    model.cameras.push_back(model.cameras[0]);
    model.cameras[1].id = 2;
    for (size_t n = 1; n < model.images.size(); n += 2) {
      model.images[n].camera_id = 2;
    }
    UseTrivialRigs(&model);
    return model;
  }

  // That the first line blames camera 2 with these words, and that the next
  // steps mend it.
  void ExpectBlamedAndMended(const Model& model, const std::string& fault,
                             const std::string& words) const {
    Save(model, folder_ / "input");
    Succeeded(RunKrot({"bundle_adjuster", "--input_path", folder_ / "input",
                       "--output_path", folder_ / "held",
                       "--BundleAdjustment.refine_focal_length", "0",
                       "--BundleAdjustment.refine_extra_params", "0",
                       "--BundleAdjustment.refine_sensor_from_rig", "0"}));
    const KrotResult result =
        Succeeded(Check("held", {"--report_path", folder_ / "r.json"}));
    EXPECT_THAT(result.out, StartsWith("Camera 2 is wrong: " + words));
    EXPECT_THAT(result.out, HasSubstr("\nWrong cameras\n"));
    const Json report = ReadJson(folder_ / "r.json");
    ASSERT_EQ(report["cameras"].size(), 1u);
    EXPECT_EQ(report["cameras"][0]["camera_id"], 2);
    EXPECT_EQ(report["cameras"][0]["fault"], fault);
    EXPECT_EQ(report["num_wrong_images"], 0);
    EXPECT_TRUE(report["is_anything_wrong"]);
    EXPECT_EQ(Check("held", {"--fail_on", "wrong"}).exit_code, 9);
    EXPECT_THAT(RunWhatIsNext(result.out),
                ElementsAre("bundle_adjuster", "model_checker"));
    EXPECT_THAT(Check("ADJUSTED").out, StartsWith("Nothing is wrong: all "));
  }
};

TEST_F(WrongCameraCommand, IsToldByItsFocalLength) {
  Model model = TwoCameras();
  model.cameras[1].params[0] *= 1.08;
  ExpectBlamedAndMended(
      model, "focal length",
      "its focal length is 1105.9 px, and its 10 images ask for about 10");
}

TEST_F(WrongCameraCommand, IsToldByItsPrincipalPoint) {
  Model model = TwoCameras();
  model.cameras[1].params[1] += 40;
  ExpectBlamedAndMended(
      model, "principal point",
      "its 10 images ask for another principal point, about ");
}

// The sample, whose points lie on surfaces, adjusted after its 2D points were
// moved by `move`, from the principal point, in one image of `every`.
class MovedPixelsCommand : public ModelCheckerCommand {
 protected:
  template <typename Move>
  Json Checked(size_t every, const Move& move) {
    Model model = Load(KROT_SAMPLE "/model");
    const std::vector<double> params = model.cameras[0].params;
    for (size_t n = 0; n < model.images.size(); n += every) {
      moved_.push_back(model.images[n].name);
      for (Point2D& point : model.images[n].points2D) {
        move(point.x -= params[1], point.y -= params[2]);
        point.x += params[1];
        point.y += params[2];
      }
    }
    Save(model, folder_ / "input");
    Succeeded(RunKrot({"bundle_adjuster", "--input_path", folder_ / "input",
                       "--output_path", folder_ / "adjusted"}));
    result_ =
        Succeeded(Check("adjusted", {"--report_path", folder_ / "r.json"}));
    return ReadJson(folder_ / "r.json");
  }

  Words moved_;
  KrotResult result_;
};

// No adjustment mends that: the steps make every photo its own camera.
TEST_F(MovedPixelsCommand, OfZoomedPhotosAreNamed) {
  const Json report = Checked(6, [](double& x, double& y) {
    x *= 1.12;
    y *= 1.12;
  });
  EXPECT_THAT(result_.out, StartsWith("Camera 1 is wrong: "));
  EXPECT_THAT(result_.out, HasSubstr(" images of its 24 ask for another lens"));
  EXPECT_THAT(result_.out,
              HasSubstr("--ImageReader.single_camera_per_image 1"));
  EXPECT_GT(report["error_correlation"], 0.4);
  ASSERT_EQ(report["cameras"].size(), 1u);
  EXPECT_EQ(report["cameras"][0]["fault"], "sharing");
  // The surest come first.
  Words named = report["cameras"][0]["image_names"];
  ASSERT_GE(named.size(), moved_.size());
  named.resize(moved_.size());
  EXPECT_THAT(named, UnorderedElementsAreArray(moved_));
}

TEST_F(MovedPixelsCommand, OfStretchedPhotosAskForTwoFocalLengths) {
  const Json report = Checked(1, [](double& x, double&) { x *= 1.1; });
  EXPECT_THAT(result_.out, HasSubstr(" ask for an fx that is not fy, and "));
  EXPECT_THAT(result_.out, HasSubstr(" the model OPENCV: "));
  EXPECT_EQ(report["cameras"][0]["fault"], "aspect ratio");
}

TEST_F(WrongCameraCommand, IsToldByItsPlaceInTheRig) {
  Model model = Scene(3);
  Pose& place = *model.rigs[0].sensors[0].sensor_from_rig;
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.01, Eigen::Vector3d(1, 2, 2) / 3).matrix();
  place = ToPose({turn * place.Rotation(), turn * place.translation});
  ExpectBlamedAndMended(
      model, "place in rig",
      "its 20 images ask for another place in its rig, turned by about 0.5");
  EXPECT_NEAR(ReadJson(folder_ / "r.json")["cameras"][0]["turn_deg"], 0.573,
              0.02);
}

TEST_F(ModelCheckerCommand, EndsWithCode9WhereAScriptAsks) {
  Succeeded(Check("faulty"));
  EXPECT_EQ(Check("faulty", {"--fail_on", "wrong"}).exit_code, 9);
}

TEST_F(ModelCheckerCommand, NamesAFocalLengthThatColmapsMapperDiscards) {
  Model model = Load(folder_ / "sound");
  Camera& camera = model.cameras[0];
  // The same photos, cut out of far larger ones.
  camera.width = 20 * camera.width;
  Save(model, folder_ / "odd");
  const KrotResult result = Succeeded(Check(
      "odd", {"--report_path", folder_ / "r.json", "--fail_on", "wrong"}));
  EXPECT_THAT(result.out,
              HasSubstr("; but 1 camera has a focal length that COLMAP's "
                        "mapper would discard.\n"));
  EXPECT_THAT(result.out, HasSubstr("Camera 1: its focal length of 1024.00 px "
                                    "is below 0.1 of its photos' larger side, "
                                    "20480 px: "));
  EXPECT_THAT(result.out, HasSubstr("--Mapper.min_focal_length_ratio"));
  const Json discarded = ReadJson(folder_ / "r.json")["discarded_cameras"];
  ASSERT_EQ(discarded.size(), 1u);
  EXPECT_EQ(discarded[0]["camera_id"], 1);
  EXPECT_EQ(discarded[0]["side_px"], 20480);
  Succeeded(Check("sound", {"--report_path", folder_ / "r.json"}));
  EXPECT_TRUE(ReadJson(folder_ / "r.json")["discarded_cameras"].empty());
}

// Five points of two images have as many coordinates as they and the second
// pose have unknowns: whatever the model is, an adjustment leaves no errors.
TEST_F(ModelCheckerCommand, SaysNothingWhereNoObservationChecksAnother) {
  const Model scene = SynthesizeScene(SceneOf(2, 30, 2, 1)).ground_truth;
  for (const size_t num : {1, 5, 6}) {
    Save(Without(
             scene,
             [&](uint64_t e) { return e >= scene.points3D[num].track_begin; }),
         folder_ / "few");
    const KrotResult result =
        Check("few", {"--output_type", "TXT", "--output_path",
                      folder_ / "cured", "--overwrite", "1"});
    if (num < 6) {
      EXPECT_THAT(result, IsRefused(3, "krot model_checker",
                                    "no observation is checked by another"))
          << num;
    } else {
      Succeeded(result);
    }
  }
}

TEST_F(ModelCheckerCommand, RefusesWhatItCannotJudge) {
  Save(WithoutTranslations(Load(folder_ / "sound")), folder_ / "nowhere");
  EXPECT_THAT(Check("nowhere"),
              IsRefused(3, "krot model_checker", "nothing to check"));
  EXPECT_EQ(Check("sound", {"--overwrite", "1"}).exit_code, 1);
}

}  // namespace
}  // namespace krot::internal
