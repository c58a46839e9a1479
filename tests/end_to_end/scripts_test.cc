#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/synthetic/scene.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"
#include "tests/end_to_end/script.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

class Scripts : public ::testing::Test {
 protected:
  Scripts() { Save(SmallLegacyModel(), folder_ / "model"); }

  void ExpectRefused(const std::string& name, const Words& arguments,
                     const std::string& part) const {
    const Words before = FileNames(folder_.path());
    const KrotResult result = RunScript(name, arguments);
    EXPECT_THAT(result, IsRefused(1, name, part));
    EXPECT_EQ(result.out, "");
    EXPECT_EQ(FileNames(folder_.path()), before);
  }

  TempFolder folder_;
};

TEST_F(Scripts, SayHowTheyAreUsed) {
  for (const char* name : {"mapper_then_krot.sh", "compare_linf_with_ba.sh",
                           "strecha_to_colmap.sh", "bal_to_colmap.sh",
                           "geodetic_to_positions.sh"}) {
    const KrotResult result = Succeeded(RunScript(name, {"-h"}));
    EXPECT_THAT(result.out, HasSubstr("Usage: " + std::string(name)));
    EXPECT_EQ(result.err, "");
  }
}

TEST_F(Scripts, RefuseWhatTheyDoNotUnderstand) {
  for (const char* name : {"mapper_then_krot.sh", "compare_linf_with_ba.sh",
                           "strecha_to_colmap.sh", "bal_to_colmap.sh",
                           "geodetic_to_positions.sh"}) {
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
  ExpectRefused("bal_to_colmap.sh",
                {"--input_path", missing, "--output_path", output},
                "is not a file");
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

// The proof, by a checker that shares no code with KROT.
TEST_F(Scripts, CheckACertificateWithoutKrot) {
  if (std::system("/usr/bin/python3 -c 'import numpy' 2>/dev/null") != 0) {
    GTEST_SKIP() << "numpy is not installed";
  }
  const std::string solved = folder_ / "solved";
  const fs::path certificate = folder_ / "certificate.json";
  Succeeded(RunKrot({"solver", "--input_path", KROT_SAMPLE "/model",
                     "--output_path", solved, "--output_type", "TXT",
                     "--certificate_path", certificate}));
  const KrotResult result =
      Succeeded(RunScript("check_certificate.py", {certificate, solved}));
  EXPECT_THAT(result.out, HasSubstr("no estimate has all errors"));

  // A bound that is higher by 1e-6 is not proved.
  auto json = ReadJson(certificate);
  json["lower_bound"] = (1 + 1e-6) * json["lower_bound"].get<double>();
  WriteBytes(certificate, json.dump());
  EXPECT_NE(RunScript("check_certificate.py", {certificate, solved}).exit_code,
            0);
}

// A scene without noise as a project of DBAT, whose lens corrects what was
// measured: x + K1 r^2 x is the pinhole's.
TEST_F(Scripts, ReadAPhotogrammetricProject) {
  if (std::system("/usr/bin/python3 -c 'import numpy' 2>/dev/null") != 0) {
    GTEST_SKIP() << "numpy is not installed";
  }
  SceneOptions options = SceneOf(5, 50, 4);
  options.camera_model_id = 0;
  options.has_rigs = false;
  const Model scene = SynthesizeScene(options).ground_truth;
  constexpr double kPixel = 0.01, kK1 = 1e-4;  // mm
  const std::vector<double>& params = scene.cameras[0].params;
  std::ofstream camera(folder_ / "camera.xml");
  camera << "<image>" << scene.cameras[0].width << ','
         << scene.cameras[0].height << "</image><sensor>auto,"
         << kPixel * static_cast<double>(scene.cameras[0].height)
         << "</sensor><cc>" << kPixel * params[0] << "</cc><pp>"
         << kPixel * params[1] << ',' << kPixel * params[2] << "</pp><K>" << kK1
         << ",0,0</K><P>0,0</P>";
  std::ofstream names(folder_ / "images.txt"), eo(folder_ / "eo.txt"),
      points(folder_ / "points.txt");
  eo.precision(17);
  points.precision(17);
  for (const Image& image : scene.images) {
    names << image.id << ", photos/" << image.name << '\n';
    const Eigen::Matrix3d R = image.cam_from_world.Rotation();
    const Eigen::Vector3d centre =
        -R.transpose() * image.cam_from_world.translation;
    const Eigen::Matrix3d M =
        (Eigen::Vector3d(1, -1, -1).asDiagonal() * R).transpose();
    constexpr double kDegrees = 57.295779513082321;
    eo << image.id << ", " << centre.x() << ", " << centre.y() << ", "
       << centre.z() << ", " << kDegrees * std::atan2(-M(1, 2), M(2, 2)) << ", "
       << kDegrees * std::asin(M(0, 2)) << ", "
       << kDegrees * std::atan2(-M(0, 1), M(0, 0)) << '\n';
    for (const Point2D& point : image.points2D) {
      const Eigen::Vector2d ideal =
          kPixel * Eigen::Vector2d(point.x - params[1], point.y - params[2]);
      Eigen::Vector2d measured = ideal;
      for (int i = 0; i < 50; ++i) {
        measured = ideal / (1 + kK1 * measured.squaredNorm());
      }
      points << image.id << ", " << point.point3D_id << ", "
             << params[1] + measured.x() / kPixel << ", "
             << params[2] + measured.y() / kPixel << '\n';
    }
  }
  for (std::ofstream* file : {&camera, &names, &eo, &points}) file->close();
  Succeeded(RunScript(
      "photogrammetry_to_colmap.py",
      {"dbat", folder_ / "camera.xml", folder_ / "images.txt",
       folder_ / "eo.txt", folder_ / "points.txt", folder_ / "converted"}));
  const Model converted = Load(folder_ / "converted");
  EXPECT_EQ(converted.points3D.size(), scene.points3D.size());
  const PixelErrorStatistics errors = Summarize(PixelErrors(converted));
  EXPECT_EQ(errors.count, static_cast<int64_t>(scene.track_elements.size()));
  EXPECT_LT(errors.max, 1e-4);
  for (size_t k = 0; k < scene.points3D.size(); ++k) {
    EXPECT_LT((converted.points3D[k].xyz - scene.points3D[k].xyz).norm(), 1e-6);
  }

  const KrotResult of_other_files = RunScript(
      "photogrammetry_to_colmap.py",
      {"dbat", folder_ / "eo.txt", folder_ / "images.txt", folder_ / "eo.txt",
       folder_ / "points.txt", folder_ / "other"});
  EXPECT_EQ(of_other_files.exit_code, 1);
  EXPECT_THAT(of_other_files.err,
              ::testing::StartsWith("found no dbat project in "));
  EXPECT_FALSE(fs::exists(folder_ / "other"));
}

bool HasColmapAndJq() {
  return HasColmap() && std::system("command -v jq >/dev/null 2>&1") == 0;
}

TEST_F(Scripts, CompareWithTheInputWhereNoTruthIsGiven) {
  if (!HasColmapAndJq()) GTEST_SKIP() << "needs colmap and jq";
  const fs::path output = folder_ / "compared";
  const KrotResult result = Succeeded(RunScript(
      "compare_linf_with_ba.sh",
      {"--input_path", folder_ / "model", "--output_path=" + output.string(),
       "--max_error_factor", "1.3"}));
  EXPECT_THAT(result.out, ::testing::StartsWith("Cameras: against the input"));
  EXPECT_THAT(result.out, HasSubstr("bounded, 1.3 x the lowest"));

  // The largest error of a result, recomputed from its files.
  const auto max_error = [&output](const std::string& name) {
    return Summarize(PixelErrors(Load(output / name))).max;
  };
  EXPECT_LE(max_error("bounded"), 1.3 * max_error("linf"));
  for (const char* name : {"colmap_ba", "ba", "cauchy", "ba_rotations"}) {
    EXPECT_LT(max_error("linf"), max_error(name)) << name;
    std::ostringstream number;
    number << std::fixed << std::setprecision(4) << max_error(name);
    EXPECT_THAT(result.out, HasSubstr(number.str())) << name;
  }
}

// COLMAP 3.8 aborts at tracks of one observation.
TEST_F(Scripts, SayWhereACommandThatFailedSaysWhy) {
  if (!HasColmapAndJq()) GTEST_SKIP() << "needs colmap and jq";
  Save(WithShortTracks(SmallLegacyModel(), 1), folder_ / "short");
  const fs::path output = folder_ / "compared";
  const KrotResult result =
      RunScript("compare_linf_with_ba.sh",
                {"--input_path", folder_ / "short", "--output_path", output});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.out, "");
  const std::string log = output / "reports/colmap_ba.log";
  EXPECT_THAT(result.err, HasSubstr("failed, as " + log + " says"));
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
  Succeeded(
      RunScript("strecha_to_colmap.sh", {"--input_path", folder_ / "survey",
                                         "--output_path", folder_ / "truth"}));
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
    const KrotResult result =
        RunScript("strecha_to_colmap.sh",
                  {"--input_path", survey, "--output_path", output});
    EXPECT_NE(result.exit_code, 0);
    EXPECT_THAT(result.err, HasSubstr(part));
    EXPECT_FALSE(fs::exists(output));
  }
}

// A problem of Bundle Adjustment in the Large, and its errors by the definition
// of its authors: P = R X + t, p = -P / P.z, f (1 + k1 |p|^2 + k2 |p|^4) p.
struct BalProblem {
  std::string text;
  std::vector<double> errors;  // in the order of the points' tracks
};

BalProblem MakeBalProblem(int num_cameras, int num_points) {
  Random random(5);
  std::ostringstream text, cameras;
  text << std::setprecision(17);
  cameras << std::setprecision(17);
  text << num_cameras << ' ' << num_points << ' ' << num_cameras * num_points
       << '\n';
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < num_points; ++k)
    points.push_back(random.GaussianVector());
  BalProblem problem;
  problem.errors.resize(num_cameras * num_points);
  for (int c = 0; c < num_cameras; ++c) {
    // One is not turned at all.
    const Eigen::Vector3d r = (c == 0 ? 0.0 : 1.5) * random.GaussianVector();
    const Eigen::Vector3d t =
        0.3 * random.GaussianVector() - Eigen::Vector3d(0, 0, 10);
    const double f = 500 + c, k1 = -0.1, k2 = 0.02;
    for (const double number :
         {r[0], r[1], r[2], t[0], t[1], t[2], f, k1, k2}) {
      cameras << number << '\n';
    }
    for (int k = 0; k < num_points; ++k) {
      const double angle = r.norm();
      const Eigen::Vector3d axis =
          angle > 0 ? Eigen::Vector3d(r / angle) : Eigen::Vector3d::UnitX();
      const Eigen::Vector3d P = Eigen::AngleAxisd(angle, axis) * points[k] + t;
      const Eigen::Vector2d p = -P.head<2>() / P[2];
      const double n = p.squaredNorm();
      const Eigen::Vector2d error = random.GaussianVector().head<2>();
      const Eigen::Vector2d observed =
          f * (1 + k1 * n + k2 * n * n) * p + error;
      text << c << ' ' << k << "     " << observed[0] << ' ' << observed[1]
           << '\n';
      problem.errors[k * num_cameras + c] = error.norm();
    }
  }
  text << cameras.str();
  for (const Eigen::Vector3d& x : points) {
    text << x[0] << '\n' << x[1] << '\n' << x[2] << '\n';
  }
  problem.text = text.str();
  return problem;
}

TEST_F(Scripts, TakeBundleAdjustmentInTheLargeToColmapWithItsErrors) {
  const BalProblem problem = MakeBalProblem(4, 12);
  WriteBytes(folder_ / "problem.txt", problem.text);
  Succeeded(
      RunScript("bal_to_colmap.sh", {"--input_path", folder_ / "problem.txt",
                                     "--output_path", folder_ / "bal"}));
  const Model model = Load(folder_ / "bal");
  EXPECT_EQ(model.images.size(), 4u);
  const std::vector<double> errors = PixelErrors(model);
  ASSERT_EQ(errors.size(), problem.errors.size());
  for (size_t i = 0; i < errors.size(); ++i) {
    EXPECT_NEAR(errors[i], problem.errors[i], 1e-9) << i;
  }
}

// As Notepad saves it: with a byte order mark and CR LF.
std::string OfWindows(const std::string& text) {
  std::string bytes = "\xef\xbb\xbf";
  for (const char c : text) bytes += c == '\n' ? "\r\n" : std::string(1, c);
  return bytes;
}

TEST_F(Scripts, TakeTextsOfWindows) {
  const std::string text = MakeBalProblem(2, 3).text;
  WriteBytes(folder_ / "unix.txt", text);
  WriteBytes(folder_ / "windows.txt", OfWindows(text));
  for (const char* name : {"unix", "windows"}) {
    Succeeded(RunScript("bal_to_colmap.sh",
                        {"--input_path", folder_ / (std::string(name) + ".txt"),
                         "--output_path", folder_ / name}));
  }
  EXPECT_THAT(Load(folder_ / "windows"), IsModel(Load(folder_ / "unix")));
}

TEST_F(Scripts, SayOfPackedFilesWhatUnpacksThem) {
  for (const auto& [bytes, program] :
       std::vector<std::pair<std::string, std::string>>{
           {"BZh91AY&SY", "bunzip2"},
           {"\x1f\x8b\x08", "gunzip"},
           {"\xfd"
            "7zXZ",
            "unxz"},
           {"PK\x03\x04", "unzip"}}) {
    WriteBytes(folder_ / "problem.txt.packed", bytes);
    ExpectRefused("bal_to_colmap.sh",
                  {"--input_path", folder_ / "problem.txt.packed",
                   "--output_path", folder_ / "output"},
                  "is packed; unpack it with " + program);
  }
}

TEST_F(Scripts, RefuseWhatIsNoProblemOfBundleAdjustmentInTheLarge) {
  const std::string text = MakeBalProblem(2, 3).text;
  int i = 0;
  for (const auto& [file, part] :
       std::vector<std::pair<std::string, std::string>>{
           {text + "5\n", "more numbers than"},
           {text.substr(0, text.size() / 2), "numbers found"},
           {"", "numbers found"},
           {"2 3 6\n0 3 1 1\n", "observation 0 is of point 3, of 3"},
           {"2 3 6\n0 x 1 1\n", "'x' is no number"}}) {
    const fs::path path = folder_ / ("problem" + std::to_string(++i) + ".txt");
    WriteBytes(path, file);
    const fs::path output = folder_ / ("output" + std::to_string(i));
    const KrotResult result = RunScript(
        "bal_to_colmap.sh", {"--input_path", path, "--output_path", output});
    EXPECT_NE(result.exit_code, 0);
    EXPECT_THAT(result.err, HasSubstr(part));
    EXPECT_FALSE(fs::exists(output));
  }
}

// From the centre of the earth, WGS84.
Eigen::Vector3d Geocentric(double latitude, double longitude, double height) {
  const double radians = std::acos(-1) / 180;
  const double f = 1 / 298.257223563;
  const double e2 = f * (2 - f);
  const double sine = std::sin(latitude * radians);
  const double cosine = std::cos(latitude * radians);
  const double n = 6378137 / std::sqrt(1 - e2 * sine * sine);
  return {(n + height) * cosine * std::cos(longitude * radians),
          (n + height) * cosine * std::sin(longitude * radians),
          (n * (1 - e2) + height) * sine};
}

TEST_F(Scripts, TakeGeodeticCoordinatesToALocalFrame) {
  if (std::system("command -v CartConvert >/dev/null 2>&1") != 0) {
    GTEST_SKIP() << "CartConvert is not installed";
  }
  WriteBytes(folder_ / "gps.txt",
             "# name, place, radius\na.jpg 48.1 16.2 200 5\n"
             "b.jpg 48.102 16.197 231.5 1 1 3\n");
  const Words arguments = {"--origin",      "48.1 16.2 200",
                           "--input_path",  folder_ / "gps.txt",
                           "--output_path", folder_ / "positions.txt"};
  Succeeded(RunScript("geodetic_to_positions.sh", arguments));
  std::istringstream text(ReadBytes(folder_ / "positions.txt"));
  std::string line, name;
  Eigen::Vector3d enu, axes;
  std::getline(text, line);
  EXPECT_EQ(line, "a.jpg 0.000000 0.000000 0.000000 5");
  text >> name >> enu[0] >> enu[1] >> enu[2] >> axes[0] >> axes[1] >> axes[2];
  EXPECT_EQ(name, "b.jpg");
  EXPECT_EQ(axes, Eigen::Vector3d(1, 1, 3));
  const Eigen::Vector3d way =
      Geocentric(48.102, 16.197, 231.5) - Geocentric(48.1, 16.2, 200);
  EXPECT_NEAR(enu.norm(), way.norm(), 1e-5);
  const Eigen::Vector3d up =
      (Geocentric(48.1, 16.2, 1200) - Geocentric(48.1, 16.2, 200)) / 1000;
  EXPECT_NEAR(enu.z(), way.dot(up), 1e-5);
  EXPECT_NEAR(enu.x(), way.dot(Eigen::Vector3d::UnitZ().cross(up).normalized()),
              1e-5);

  ExpectRefused("geodetic_to_positions.sh", arguments, "exists");
  // The same with a header, commas, blanks in names, and without radii.
  WriteBytes(
      folder_ / "gps.csv",
      OfWindows("name,lat,lon,height\n"
                "my a.jpg,48.1,16.2,200\nmy b.jpg\t48.102\t16.197\t231.5\n"));
  const KrotResult table = Succeeded(
      RunScript("geodetic_to_positions.sh",
                {"--origin", "48.1 16.2 200", "--input_path",
                 folder_ / "gps.csv", "--output_path", folder_ / "table.txt"}));
  std::ostringstream expected;
  expected << std::fixed << std::setprecision(6)
           << "my a.jpg 0.000000 0.000000 0.000000\nmy b.jpg " << enu[0] << ' '
           << enu[1] << ' ' << enu[2] << '\n';
  EXPECT_EQ(ReadBytes(folder_ / "table.txt"), expected.str());
  int i = 0;
  for (const auto& [file, part] :
       std::vector<std::pair<std::string, std::string>>{
           {"a.jpg 98.1 16.2 200 5\n", "not in [-90d, 90d]"},
           {"a.jpg 48.1 16.2\n", "expected NAME LATITUDE"},
           {"a.jpg 48,1 16,2 200 5\n", "expected decimal points"},
           {"# nothing\n", "found no position"}}) {
    const fs::path path = folder_ / ("gps" + std::to_string(++i) + ".txt");
    WriteBytes(path, file);
    const KrotResult refused =
        RunScript("geodetic_to_positions.sh",
                  {"--origin", "48.1 16.2 200", "--input_path", path,
                   "--output_path", folder_ / "none.txt"});
    EXPECT_NE(refused.exit_code, 0);
    EXPECT_THAT(refused.err, HasSubstr(part));
    EXPECT_FALSE(fs::exists(folder_ / "none.txt"));
  }
}

}  // namespace
}  // namespace krot::internal
