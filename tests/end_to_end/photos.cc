#include "tests/end_to_end/photos.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <stdexcept>
#include <string>

#include "krot/camera/camera_model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 512;
constexpr int kHeight = 384;
constexpr int kNumViews = 24;  // of the sample
constexpr int kFirstView = 8;
constexpr int kLastView = 17;

std::string PhotoName(int view) {
  std::string digits = std::to_string(view);
  digits.insert(0, 2 - digits.size(), '0');
  return "view" + digits + ".ppm";
}

// The camera of the full-sized views, "CAMERA MODEL WIDTH HEIGHT F CX CY", at
// the size of the photos.
Camera ScaledCamera(std::istringstream* line) {
  std::string name;
  double width = 0, height = 0;
  Camera camera;
  camera.params.resize(3);
  *line >> name >> width >> height;
  for (double& param : camera.params) *line >> param;
  const double scale = kWidth / width;
  if (!*line || scale * height != kHeight) {
    throw std::runtime_error("ground_truth.txt: another camera expected");
  }
  camera.id = 1;
  camera.model_id = FindCameraModel(name)->id;
  camera.width = kWidth;
  camera.height = kHeight;
  for (double& param : camera.params) param *= scale;
  return camera;
}

}  // namespace

bool HasPovray() {
  return std::system("command -v povray >/dev/null 2>&1") == 0;
}

bool RenderPhotos(const fs::path& folder, const fs::path& log) {
  fs::create_directories(folder);
  std::ostringstream command;
  const auto option = [&command](const char* name, auto value) {
    command << " '" << name << value << "'";
  };
  command << "povray -D -GA +FP +A0.1 +AM2 +R2 -J";
  option("+L", KROT_SAMPLE);
  option("+I", std::string(KROT_SAMPLE) + "/scene.pov");
  option("+O", (folder / "view.ppm").string());
  option("+W", kWidth);
  option("+H", kHeight);
  option("+KFI", 1);
  option("+KFF", kNumViews);
  option("+SF", kFirstView);
  option("+EF", kLastView);
  command << " >'" << log.string() << "' 2>&1";
  return std::system(command.str().c_str()) == 0 &&
         fs::exists(folder / PhotoName(kLastView));
}

Model TrueCameras() {
  Model model;
  std::istringstream lines(
      ReadBytes(fs::path(KROT_SAMPLE) / "model/ground_truth.txt"));
  int view = 0;
  for (std::string text; std::getline(lines, text);) {
    std::istringstream line(text);
    std::string word;
    line >> word;
    if (word == "#") continue;
    if (word == "CAMERA") {
      model.cameras = {ScaledCamera(&line)};
      continue;
    }
    ++view;
    if (view < kFirstView || view > kLastView) continue;
    Image image;
    image.id = static_cast<ImageId>(view);
    image.camera_id = 1;
    image.name = PhotoName(view);
    for (double& q : image.cam_from_world.quaternion_wxyz) line >> q;
    for (double& t : image.cam_from_world.translation) line >> t;
    if (!line) throw std::runtime_error("ground_truth.txt: " + text);
    model.images.push_back(image);
  }
  return model;
}

void AddNoise(const fs::path& folder, double sigma, uint64_t seed,
              const fs::path& noisy_folder) {
  Random random(seed);
  constexpr size_t kNumBytes = size_t{3} * kWidth * kHeight;
  for (const std::string& name : FileNames(folder)) {
    std::string photo = ReadBytes(folder / name);
    // The header is all that stands before the pixels.
    for (size_t i = photo.size() - kNumBytes; i < photo.size(); ++i) {
      const double level =
          static_cast<unsigned char>(photo[i]) + sigma * random.Gaussian();
      photo[i] = static_cast<char>(std::lround(std::clamp(level, 0.0, 255.0)));
    }
    WriteBytes(noisy_folder / name, photo);
  }
}

}  // namespace krot::internal
