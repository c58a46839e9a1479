#include <cstdlib>
#include <fstream>
#include <limits>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "krot/analysis/model_statistics.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

class ModelComparer : public ::testing::Test {
 protected:
  ModelComparer() {
    Save(SmallLegacyModel(), folder_ / "a");
    Save(Perturbed(SmallLegacyModel(), 0.001, 5), folder_ / "b");
  }

  KrotResult Compare(const fs::path& path1, const fs::path& path2,
                     const Words& more = {}) const {
    return RunKrot(
        {"model_comparer", "--input_path1", path1, "--input_path2", path2},
        more);
  }

  Json Report(const fs::path& path1, const fs::path& path2,
              Words more = {}) const {
    const KrotResult result = Succeeded(Compare(
        path1, path2, more + Words{"--report_path", folder_ / "report.json"}));
    EXPECT_EQ(result.err, "");
    return ReadJson(folder_ / "report.json");
  }

  void ExpectRefused(const KrotResult& result, int exit_code,
                     const std::string& part) const {
    EXPECT_EQ(result.exit_code, exit_code);
    EXPECT_THAT(result.err, IsOneSentence("krot model_comparer", part));
    EXPECT_EQ(result.out, "");
  }

  TempFolder folder_;
};

// The rows "| `key` |" of a section, several keys in one cell included.
std::set<std::string> DocumentedKeys(const std::string& section) {
  std::istringstream lines(ReadBytes(KROT_FORMATS_DOCUMENT));
  std::set<std::string> keys;
  bool is_inside = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("## ", 0) == 0) is_inside = line == "## " + section;
    if (!is_inside || line.rfind("| `", 0) != 0) continue;
    std::string cell = line.substr(2, line.find(" |", 2) - 2);
    const std::regex key("`([A-Za-z0-9_]+)`");
    for (std::smatch match; std::regex_search(cell, match, key);
         cell = match.suffix()) {
      keys.insert(match[1]);
    }
  }
  return keys;
}

std::set<std::string> Keys(const Json& object) {
  std::set<std::string> keys;
  for (const auto& [key, value] : object.items()) keys.insert(key);
  return keys;
}

TEST_F(ModelComparer, ReportsTheKeysThatAreDocumented) {
  const Json report = Report(folder_ / "a", folder_ / "b");
  EXPECT_EQ(Keys(report), DocumentedKeys("Comparison report"));
}

TEST_F(ModelComparer, FindsNoDifferenceBetweenAModelAndItself) {
  for (const char* alignment : {"frame", "similarity", "none"}) {
    const Json report =
        Report(folder_ / "a", folder_ / "a", {"--alignment", alignment});
    EXPECT_EQ(report["alignment"]["kind"], alignment);
    EXPECT_EQ(report["alignment"]["scale"], 1);
    for (const char* difference : {"rotation_deg", "center", "point"}) {
      EXPECT_GT(report[difference]["count"], 0);
      EXPECT_EQ(report[difference]["max"], 0);
      EXPECT_EQ(report[difference]["rms"], 0);
    }
    EXPECT_EQ(report["pixel_error"]["model1"], report["pixel_error"]["model2"]);
    EXPECT_EQ(report["num_points"]["shared"], report["num_points"]["model1"]);
  }
}

TEST_F(ModelComparer, SaysInItsTableHowItAligned) {
  const auto table = [this](const char* alignment) {
    return Compare(folder_ / "a", folder_ / "b", {"--alignment", alignment})
        .out;
  };
  EXPECT_THAT(table("none"), HasSubstr("as stored, not aligned"));
  EXPECT_THAT(table("frame"), HasSubstr("the frame of model 1"));
  EXPECT_THAT(table("similarity"), HasSubstr("fits the camera centres"));
}

TEST_F(ModelComparer, ShowsWhatACertificateProves) {
  const std::string certificate = folder_ / "certificate.json";
  Succeeded(RunKrot({"solver", "--input_path", folder_ / "a", "--output_path",
                     folder_ / "solved", "--certificate_path", certificate}));
  const Json report = Report(
      folder_ / "a", folder_ / "solved",
      {"--certificate_path1", certificate, "--certificate_path2", certificate});
  const Json file = ReadJson(certificate);
  for (const char* model : {"model1", "model2"}) {
    const Json& verdict = report["certificate"][model];
    EXPECT_NEAR(verdict["lower_bound"], file["lower_bound"],
                1e-6 * file["lower_bound"].get<double>());
    EXPECT_EQ(verdict["num_support"], file["observations"].size());
  }
  // The finish may give up 5e-4 of the lowest maximum.
  EXPECT_LE(report["certificate"]["model2"]["relative_gap"], 5e-4);
  EXPECT_GT(report["certificate"]["model1"]["relative_gap"], 5e-4);

  Model turned = SmallLegacyModel();
  turned.images[0].cam_from_world.quaternion_wxyz = {1, 0, 0, 0};
  Save(turned, folder_ / "turned");
  ExpectRefused(Compare(folder_ / "a", folder_ / "turned",
                        {"--certificate_path2", certificate}),
                4, "refused");
}

TEST_F(ModelComparer, WritesColmapsErrorFiles) {
  const fs::path output = folder_ / "new/errors";
  const KrotResult result = Succeeded(
      Compare(folder_ / "a", folder_ / "b", {"--output_path", output}));
  EXPECT_EQ(ReadBytes(output / "errors_summary.txt"), result.out);
  const Json images = Report(folder_ / "a", folder_ / "b")["images"];
  std::istringstream lines(ReadBytes(output / "errors.csv"));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line.front(), '#');
  for (const Json& image : images) {
    ASSERT_TRUE(std::getline(lines, line));
    double rotation_deg = -1;
    double center = -1;
    std::string name;
    char comma = 0;
    std::istringstream(line) >> rotation_deg >> comma >> center >> comma >>
        name;
    EXPECT_EQ(rotation_deg, image["rotation_deg"]);
    EXPECT_EQ(center, image["center"]);
    EXPECT_EQ(name, image["image_name"]);
  }
  EXPECT_FALSE(std::getline(lines, line));
}

TEST_F(ModelComparer, SaysWhenThereIsNothingToCompare) {
  Model other = SmallLegacyModel();
  for (Image& image : other.images) image.name += ".png";
  Save(other, folder_ / "other");
  ExpectRefused(Compare(folder_ / "a", folder_ / "other"), 3, "share no image");
}

TEST_F(ModelComparer, NeedsThreePosesForASimilarityAndOneForAFrame) {
  Model few = SmallLegacyModel();
  const double kNaN = std::numeric_limits<double>::quiet_NaN();
  for (size_t n = 2; n < few.images.size(); ++n) {
    few.images[n].cam_from_world.translation.setConstant(kNaN);
  }
  Save(few, folder_ / "few");
  Save(WithoutTranslations(few), folder_ / "none");
  ExpectRefused(
      Compare(folder_ / "a", folder_ / "few", {"--alignment", "similarity"}), 1,
      "there are 2; use --alignment frame or none");
  Succeeded(Compare(folder_ / "a", folder_ / "few"));
  ExpectRefused(Compare(folder_ / "a", folder_ / "none"), 1,
                "use --alignment none");
  const Json report =
      Report(folder_ / "a", folder_ / "none", {"--alignment", "none"});
  EXPECT_EQ(report["num_shared_poses"], 0);
  EXPECT_TRUE(report["center"]["max"].is_null());
  EXPECT_TRUE(report["scene_radius"].is_null());
  EXPECT_TRUE(report["images"][0]["center"].is_null());
  EXPECT_TRUE(report["pixel_error"]["model2"]["max"].is_null());
}

TEST_F(ModelComparer, RefusesPathsThatItCannotUse) {
  const fs::path a = folder_ / "a";
  const fs::path b = folder_ / "b";
  const Words names = FileNames(folder_.path());
  ExpectRefused(Compare(a, folder_ / "missing"), 2, "missing");
  ExpectRefused(Compare(a, b, {"--overlay_path", b, "--overwrite", "1"}), 1,
                "must not be a model that is compared");
  ExpectRefused(Compare(a, b, {"--overwrite", "1"}), 1, "--overlay_path");
  ExpectRefused(Compare(a, b, {"--report_path", folder_ / "x/r.json"}), 5,
                "no folder");
  ExpectRefused(Compare(a, b, {"--report_path", a / "images.bin"}), 1,
                "name of a model's file");
  WriteBytes(folder_ / "file", "");
  ExpectRefused(Compare(a, b, {"--output_path", folder_ / "file"}), 5, "file");
  fs::remove(folder_ / "file");
  EXPECT_EQ(FileNames(folder_.path()), names);
}

TEST_F(ModelComparer, ReplacesAnOverlayOnlyIfTold) {
  const std::string overlay = folder_ / "overlay";
  const auto compare = [&](const std::string& overwrite) {
    return Compare(folder_ / "a", folder_ / "b",
                   {"--overlay_path", overlay, "--overwrite", overwrite});
  };
  EXPECT_EQ(compare("0").exit_code, 0);
  ExpectRefused(compare("0"), 5, "overwrite");
  EXPECT_EQ(compare("1").exit_code, 0);
}

// What a command of COLMAP prints; fails if it fails.
std::string Colmap(const Words& arguments, const fs::path& log) {
  EXPECT_TRUE(RunColmap(arguments, log)) << ReadBytes(log);
  return ReadBytes(log);
}

void ExpectColmapReads(const fs::path& overlay, const fs::path& scratch) {
  fs::create_directories(scratch / "text");
  const Model model = Load(overlay);
  const std::string figures =
      Colmap({"model_analyzer", "--path", overlay}, scratch / "log");
  EXPECT_THAT(figures, HasSubstr("Registered images: " +
                                 std::to_string(model.images.size())));
  EXPECT_THAT(figures,
              HasSubstr("Points: " + std::to_string(model.points3D.size())));
  Colmap({"model_converter", "--input_path", overlay, "--output_path",
          scratch / "text", "--output_type", "TXT"},
         scratch / "log");
  const Model converted = Load(scratch / "text");
  EXPECT_EQ(converted.images.size(), model.images.size());
  EXPECT_EQ(converted.track_elements.size(), model.track_elements.size());
  for (const Point3D& point : converted.points3D) {
    EXPECT_TRUE(point.color == kOverlayColor1 || point.color == kOverlayColor2);
  }
}

TEST_F(ModelComparer, OverlaysLegacyAndRigModelsForColmap) {
  if (!HasColmap()) GTEST_SKIP() << "colmap is not installed";
  SceneOptions rigs = SmallScene();
  rigs.sensors_per_rig = 2;
  Save(SynthesizeScene(rigs).model, folder_ / "rigs");
  rigs.start_point_noise = 0;
  Save(SynthesizeScene(rigs).model, folder_ / "rigs2");
  for (const auto& [name1, name2] :
       {std::pair("a", "b"), std::pair("rigs", "rigs2")}) {
    for (const char* type : {"BIN", "TXT"}) {
      Succeeded(Compare(folder_ / name1, folder_ / name2,
                        {"--overlay_path", folder_ / "overlay", "--output_type",
                         type, "--overwrite", "1"}));
      ExpectColmapReads(folder_ / "overlay", folder_ / "scratch");
    }
  }
}

// The similarity of tools/sample/align.awk is Horn's, on quaternions: it
// shares no code with ours.
TEST_F(ModelComparer, AgreesWithTheSamplesOwnCheckOnItsGroundTruth) {
  const fs::path sample = KROT_SAMPLE;
  Save(Load(sample / "model"), folder_ / "text", ModelFormat::kText);
  std::ifstream truth(sample / "model/ground_truth.txt");
  std::ostringstream cameras;
  std::ostringstream images;
  int num_images = 0;
  for (std::string line; std::getline(truth, line);) {
    const std::string word = line.substr(0, line.find(' '));
    const std::string rest = line.substr(line.find(' ') + 1);
    if (word == "CAMERA") {
      cameras << "1 " << rest << '\n';
    } else if (word != "#") {
      images << ++num_images << ' ' << rest << " 1 " << word << "\n\n";
    }
  }
  WriteBytes(folder_ / "truth/cameras.txt", cameras.str());
  WriteBytes(folder_ / "truth/images.txt", images.str());
  WriteBytes(folder_ / "truth/points3D.txt", "");
  const Json report = Report(folder_ / "truth", folder_ / "text",
                             {"--alignment", "similarity"});

  const std::string command = "awk -f '" + (sample / "align.awk").string() +
                              "' '" +
                              (sample / "model/ground_truth.txt").string() +
                              "' '" + (folder_ / "text/cameras.txt").string() +
                              "' '" + (folder_ / "text/images.txt").string() +
                              "' > '" + (folder_ / "awk").string() + "'";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const std::string text = ReadBytes(folder_ / "awk");
  const auto figure = [&text](const std::string& label) {
    const size_t found = text.find(label);
    EXPECT_NE(found, std::string::npos) << text;
    return std::strtod(text.c_str() + found + label.size(), nullptr);
  };
  // As many digits as it prints.
  EXPECT_EQ(report["num_shared_poses"], 24);
  const double radius = report["scene_radius"];
  EXPECT_NEAR(radius, figure("\nscene size"), 0.5001e-4);
  const double rms = report["center"]["rms"].get<double>() / radius;
  EXPECT_NEAR(rms, figure("RMS / scene size"), 0.5001e-6);
  // Horn's scale is the ratio of the radii; the least squares' is smaller by
  // the cosine that the residuals make, 1 - rms^2 / 2.
  const double scale = report["alignment"]["scale"];
  EXPECT_NEAR(scale / (1 - rms * rms / 2), figure(", scale"), 0.5001e-6);
  EXPECT_NEAR(report["rotation_deg"]["max"], figure("largest angle"),
              0.5001e-4);
}

TEST_F(ModelComparer, ComparesRealModelsWithTheirSolutions) {
  const std::optional<fs::path> real = RealModels();
  if (!real) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  for (const char* name : {"crane8_txt", "task41_rigs_frames"}) {
    Succeeded(RunKrot({"solver", "--input_path", *real / name, "--output_path",
                       folder_ / "solved", "--overwrite", "1"}));
    // The solver keeps the frame: aligning by it must not move anything.
    const Json report =
        Report(*real / name, folder_ / "solved",
               {"--overlay_path", folder_ / "overlay", "--overwrite", "1"});
    EXPECT_NEAR(report["alignment"]["scale"], 1, 1e-12);
    for (const double t : report["alignment"]["translation"]) {
      EXPECT_NEAR(t, 0, 1e-12 * report["scene_radius"].get<double>());
    }
    EXPECT_LE(report["rotation_deg"]["max"], 1e-12);
    EXPECT_EQ(report["num_points"]["shared"], report["num_points"]["model1"]);
    EXPECT_LT(report["pixel_error"]["model2"]["max"],
              report["pixel_error"]["model1"]["max"]);
    if (HasColmap()) {
      ExpectColmapReads(folder_ / "overlay", folder_ / "scratch");
    }
  }
}

}  // namespace
}  // namespace krot::internal
