#include <stdlib.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "tests/camera/random_camera.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

// A text model for COLMAP: per camera two images, the second one moved by
// (0.1, 0, 0), and points that both observe, each at its projection plus an
// offset. The offsets' mean length is then the error of the point.
class OracleModel {
 public:
  void AddCamera(int model_id, const std::vector<double>& params) {
    ++num_cameras_;
    cameras_ << num_cameras_ << ' ' << ModelName(model_id) << " 4000 3000";
    for (const double param : params) cameras_ << ' ' << param;
    cameras_ << '\n';

    std::ostringstream observations[2];
    const int images[2] = {2 * num_cameras_ - 1, 2 * num_cameras_};
    for (auto& line : observations) line << std::setprecision(17);
    for (int i = 0; i < kPointsPerCamera; ++i) {
      const int64_t point_id = static_cast<int64_t>(errors_px_.size()) + 1;
      const Eigen::Vector2d u = RandomRay(i % 10 ? 0.8 : 0.015, &random_);
      points_ << point_id << ' ' << 2 * u.x() << ' ' << 2 * u.y()
              << " 2 0 0 0 -1 " << images[0] << ' ' << i << ' ' << images[1]
              << ' ' << i << '\n';
      double sum_px = 0;
      for (int view = 0; view < 2; ++view) {
        // x_cam = x_world + (0.1 view, 0, 0) at depth 2.
        const Eigen::Vector2d offset = 5 * RandomRay(1, &random_);
        const Eigen::Vector2d pixel =
            ProjectRay({model_id, params.data()},
                       u + Eigen::Vector2d(0.05 * view, 0)) +
            offset;
        observations[view] << pixel.x() << ' ' << pixel.y() << ' ' << point_id
                           << ' ';
        sum_px += offset.norm();
      }
      errors_px_[point_id] = sum_px / 2;
    }
    for (int view = 0; view < 2; ++view) {
      images_ << images[view] << " 1 0 0 0 " << 0.1 * view << " 0 0 "
              << num_cameras_ << ' ' << images[view] << ".png\n"
              << observations[view].str() << '\n';
    }
  }

  void Write(const fs::path& folder) const {
    fs::create_directories(folder);
    std::ofstream(folder / "cameras.txt") << cameras_.str();
    std::ofstream(folder / "images.txt") << images_.str();
    std::ofstream(folder / "points3D.txt") << points_.str();
  }

  const std::map<int64_t, double>& errors_px() const { return errors_px_; }

 private:
  static constexpr int kPointsPerCamera = 100;

  static std::ostringstream ExactStream() {
    std::ostringstream stream;
    stream << std::setprecision(17);
    return stream;
  }

  std::mt19937 random_{11};
  int num_cameras_ = 0;
  std::ostringstream cameras_ = ExactStream();
  std::ostringstream images_ = ExactStream();
  std::ostringstream points_ = ExactStream();
  std::map<int64_t, double> errors_px_;
};

template <typename T>
T Read(std::istream* stream) {
  T value;
  stream->read(reinterpret_cast<char*>(&value), sizeof(T));
  return value;
}

// The stored error of every point in points3D.bin.
std::map<int64_t, double> ReadPointErrors(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::map<int64_t, double> errors;
  const uint64_t count = Read<uint64_t>(&file);
  for (uint64_t i = 0; i < count && file; ++i) {
    const int64_t id = Read<int64_t>(&file);
    file.ignore(3 * sizeof(double) + 3);  // position, colour
    errors[id] = Read<double>(&file);
    const uint64_t track_length = Read<uint64_t>(&file);
    file.ignore(static_cast<std::streamsize>(track_length) * 8);
  }
  return errors;
}

// COLMAP 3.8 recomputes the errors with its own camera models 0 to 10.
TEST(ColmapOracle, AgreesOnThePixelErrorsOfModelsZeroToTen) {
  if (std::system("command -v colmap > /dev/null 2>&1") != 0) {
    GTEST_SKIP() << "colmap is not installed";
  }
  std::mt19937 random(12);
  OracleModel model;
  for (int model_id = 0; model_id <= 10; ++model_id) {
    model.AddCamera(model_id, RandomCamera(model_id, &random).params());
  }
  const int fov = FindCameraModel("FOV")->id;
  model.AddCamera(fov, {1500, 1600, 2000, 1500, 5e-3});  // small omega

  std::string name = testing::TempDir() + "/krot_colmap_oracle_XXXXXX";
  ASSERT_NE(mkdtemp(name.data()), nullptr);
  const fs::path folder = name;
  model.Write(folder / "input");
  fs::create_directories(folder / "output");
  const std::string command =
      "QT_QPA_PLATFORM=offscreen colmap point_filtering --input_path '" +
      (folder / "input").string() + "' --output_path '" +
      (folder / "output").string() +
      "' --max_reproj_error 1e6 --min_tri_angle 0 > /dev/null 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << command;

  const auto actual = ReadPointErrors(folder / "output" / "points3D.bin");
  ASSERT_EQ(actual.size(), model.errors_px().size());
  for (const auto& [id, error_px] : model.errors_px()) {
    EXPECT_NEAR(actual.at(id), error_px, 1e-6) << "camera " << (id - 1) / 100;
  }
  fs::remove_all(folder);
}

}  // namespace
}  // namespace krot::internal
