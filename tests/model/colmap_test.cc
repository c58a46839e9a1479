#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

// COLMAP itself as the judge, if it is installed.

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

bool HasColmap() {
  return std::system("command -v colmap >/dev/null 2>&1") == 0;
}

// `type` is BIN or TXT.
void Convert(const fs::path& input, const fs::path& output,
             const std::string& type) {
  fs::create_directories(output);
  const std::string command =
      "QT_QPA_PLATFORM=offscreen colmap model_converter --input_path '" +
      input.string() + "' --output_path '" + output.string() +
      "' --output_type " + type + " >/dev/null 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
}

void WriteForColmap(const Model& model, const fs::path& folder,
                    ModelFormat format) {
  WriteModelOptions options;
  options.format = format;
  WriteModel(model, folder, options);
}

// The tiny model with what COLMAP 3.8 would alter taken out: it normalises
// quaternions, and its text reader stops names at blanks and knows no NaN.
Model TinyColmapModel() {
  Model model = TinyModel();
  model.images[0].name = "left/ab.jpg";
  model.images[1].cam_from_world.translation = {1, 2, 3};
  model.images[2].cam_from_world.quaternion_wxyz = {0, 0, 1, 0};
  UseTrivialRigs(&model);
  return model;
}

template <typename Record>
void SortById(std::vector<Record>* records) {
  std::sort(records->begin(), records->end(),
            [](const Record& a, const Record& b) { return a.id < b.id; });
}

// COLMAP 3.8 writes images and points in the order of a hash table.
Model Sorted(Model model) {
  SortById(&model.cameras);
  SortById(&model.images);
  UseTrivialRigs(&model);
  SortById(&model.points3D);
  std::vector<TrackElement> track_elements;
  for (Point3D& point : model.points3D) {
    const auto begin = model.track_elements.begin();
    const uint64_t new_begin = track_elements.size();
    track_elements.insert(track_elements.end(), begin + point.track_begin,
                          begin + point.track_end);
    point.track_begin = new_begin;
    point.track_end = track_elements.size();
  }
  model.track_elements = track_elements;
  return model;
}

TEST(Colmap, ReadsWhatIsWrittenHereAndWritesWhatIsReadHere) {
  if (!HasColmap()) GTEST_SKIP() << "colmap is not installed";
  const Model model = TinyColmapModel();
  const TempFolder folder;
  WriteForColmap(model, folder / "binary", ModelFormat::kBinary);
  WriteForColmap(model, folder / "text", ModelFormat::kText);
  Convert(folder / "binary", folder / "binary-to-text", "TXT");
  Convert(folder / "text", folder / "text-to-binary", "BIN");

  const Model from_text =
      ReadModel(folder / "binary-to-text", ModelFormat::kText);
  const Model from_binary =
      ReadModel(folder / "text-to-binary", ModelFormat::kBinary);
  EXPECT_THAT(Sorted(from_text), IsModel(Sorted(model)));
  EXPECT_THAT(Sorted(from_binary), IsModel(Sorted(model)));

  WriteForColmap(from_binary, folder / "again", ModelFormat::kBinary);
  for (const std::string& name : FileNames(folder / "again")) {
    EXPECT_EQ(ReadBytes(folder / "again" / name),
              ReadBytes(folder / "text-to-binary" / name))
        << name;
  }
}

}  // namespace
}  // namespace krot::internal
