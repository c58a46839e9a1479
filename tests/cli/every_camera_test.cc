// From nothing to a certified model, for every camera model, by the command
// line; COLMAP finds the same errors in it.

#include <string>
#include <unordered_map>

#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

namespace krot::internal {
namespace {

constexpr int kLastOfColmap38 = 10;

class EveryCameraOfCommands : public ::testing::TestWithParam<int> {
 protected:
  std::string ModelName() const {
    return std::string(FindCameraModel(GetParam())->name);
  }
  // Wide: up to 81 degrees off the axis, or all around.
  void SynthesizeAndSolve() const {
    Succeeded(RunKrot({"model_synthesizer", "--output_path", folder_ / "input",
                       "--Scene.camera_model", ModelName(),
                       "--Scene.focal_length_factor", "0.5",
                       "--Scene.num_frames", "6", "--Scene.num_points", "60",
                       "--Scene.track_length", "4", "--Scene.pixel_noise", "1",
                       "--Scene.start_point_noise", "0.01"}));
    Succeeded(
        RunKrot({"solver", "--input_path", folder_ / "input", "--output_path",
                 folder_ / "output", "--report_path", folder_ / "report.json",
                 "--certificate_path", folder_ / "certificate.json"}));
  }

  TempFolder folder_;
};

// Those that Debian's COLMAP knows.
class EveryCameraOfColmap : public EveryCameraOfCommands {};

std::string CameraName(const ::testing::TestParamInfo<int>& test) {
  return std::string(FindCameraModel(test.param)->name);
}

INSTANTIATE_TEST_SUITE_P(Models, EveryCameraOfCommands, ::testing::Range(0, 18),
                         CameraName);
INSTANTIATE_TEST_SUITE_P(Models, EveryCameraOfColmap,
                         ::testing::Range(0, kLastOfColmap38 + 1), CameraName);

TEST_P(EveryCameraOfCommands, IsSynthesizedSolvedAndCertified) {
  SynthesizeAndSolve();
  const auto report = ReadJson(folder_ / "report.json");
  EXPECT_EQ(report["termination"], "gap_reached");
  EXPECT_EQ(report["certified"], true);
  EXPECT_LT(report["cost_final"], report["cost_initial"].get<double>());
  Succeeded(RunKrot({"certificate_checker", "--input_path", folder_ / "output",
                     "--certificate_path", folder_ / "certificate.json"}));
}

TEST_P(EveryCameraOfColmap, HasTheErrorsThatColmapFinds) {
  if (!HasColmap()) GTEST_SKIP() << "colmap is not installed";
  SynthesizeAndSolve();
  std::filesystem::create_directories(folder_ / "filtered");
  ASSERT_TRUE(
      RunColmap({"point_filtering", "--max_reproj_error", "1e6",
                 "--min_tri_angle", "0", "--input_path", folder_ / "output",
                 "--output_path", folder_ / "filtered"},
                folder_ / "log"))
      << ReadBytes(folder_ / "log");
  std::unordered_map<Point3DId, double> of_colmap;
  for (const Point3D& point : Load(folder_ / "filtered").points3D) {
    of_colmap[point.id] = point.error;
  }
  const Model model = Load(folder_ / "output");
  ASSERT_EQ(of_colmap.size(), model.points3D.size());
  for (const Point3D& point : model.points3D) {
    EXPECT_NEAR(point.error, of_colmap.at(point.id), 1e-6);
  }
}

}  // namespace
}  // namespace krot::internal
