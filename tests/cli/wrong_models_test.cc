#include <algorithm>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

// Every way in which an input can be wrong: one sentence, the documented exit
// code, nothing written.

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

Words Lines(const std::string& text) {
  Words lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string Joined(const Words& parts, char separator) {
  std::string text;
  for (const std::string& part : parts) text += part + separator;
  return text;
}

// Of the file's lines that are no comments.
size_t FirstRecord(const Words& lines) {
  size_t line = 0;
  while (lines.at(line).rfind('#', 0) == 0) ++line;
  return line;
}

// Replaces fields [begin, begin + values.size()) of a text file's first
// record.
void SetFields(const fs::path& file, size_t begin, const Words& values) {
  Words lines = Lines(ReadBytes(file));
  std::string& record = lines[FirstRecord(lines)];
  Words fields;
  std::istringstream stream(record);
  for (std::string field; stream >> field;) fields.push_back(field);
  for (size_t i = 0; i < values.size(); ++i) fields.at(begin + i) = values[i];
  record = Joined(fields, ' ');
  WriteBytes(file, Joined(lines, '\n'));
}

// Writes the first record, `num_lines` long, a second time.
void RepeatRecord(const fs::path& file, size_t num_lines) {
  Words lines = Lines(ReadBytes(file));
  const auto begin = lines.begin() + FirstRecord(lines);
  const Words record(begin, begin + num_lines);
  lines.insert(lines.end(), record.begin(), record.end());
  WriteBytes(file, Joined(lines, '\n'));
}

void SetCount(const fs::path& file, const std::string& eight_bytes) {
  std::string bytes = ReadBytes(file);
  bytes.replace(0, 8, eight_bytes);
  WriteBytes(file, bytes);
}

struct WrongModel {
  const char* name;
  ModelFormat format;
  std::function<void(const fs::path& folder)> damage;
  int exit_code;
  const char* part_of_sentence;
};

std::ostream& operator<<(std::ostream& stream, const WrongModel& wrong) {
  return stream << wrong.name;
}

constexpr ModelFormat kBinary = ModelFormat::kBinary;
constexpr ModelFormat kText = ModelFormat::kText;

std::vector<WrongModel> DamagedFiles() {
  return {
      {"MissingFolder", kText, [](const fs::path& f) { fs::remove_all(f); }, 2,
       "no such folder"},
      {"AFileInsteadOfAFolder", kText,
       [](const fs::path& f) {
         fs::remove_all(f);
         WriteBytes(f, "cameras");
       },
       2, "input"},
      {"EmptyFolder", kText,
       [](const fs::path& f) {
         fs::remove_all(f);
         fs::create_directory(f);
       },
       2, "cameras"},
      {"MissingFile", kText,
       [](const fs::path& f) { fs::remove(f / "points3D.txt"); }, 2,
       "points3D"},
      {"ModelInSubfolder", kText,
       [](const fs::path& f) {
         fs::rename(f, f.parent_path() / "moved");
         fs::create_directory(f);
         fs::rename(f.parent_path() / "moved", f / "0");
       },
       2, "0"},
      {"TruncatedFile", kBinary,
       [](const fs::path& f) {
         fs::resize_file(f / "images.bin", fs::file_size(f / "images.bin") / 2);
       },
       2, "images.bin"},
      {"CountLargerThanTheFile", kBinary,
       [](const fs::path& f) {
         SetCount(f / "points3D.bin",
                  {'\0', '\0', '\0', '\0', '\0', '\0', '\1', '\0'});
       },
       2, "points3D.bin"},
      {"LargestCount", kBinary,
       [](const fs::path& f) {
         SetCount(f / "images.bin", std::string(8, '\xff'));
       },
       2, "images.bin"},
      {"GitLfsPointer", kBinary,
       [](const fs::path& f) {
         for (const char* name :
              {"cameras.bin", "images.bin", "points3D.bin"}) {
           WriteBytes(f / name,
                      "version https://git-lfs.github.com/spec/v1\n"
                      "oid sha256:0123456789abcdef\nsize 12345\n");
         }
       },
       2, "Git LFS"},
      {"TextThatIsNoNumber", kText,
       [](const fs::path& f) { SetFields(f / "points3D.txt", 1, {"abc"}); }, 2,
       "abc"},
  };
}

std::vector<WrongModel> InconsistentModels() {
  return {
      {"UnknownCameraId", kText,
       [](const fs::path& f) { SetFields(f / "images.txt", 8, {"999"}); }, 2,
       "999"},
      {"UnknownCameraModel", kText,
       [](const fs::path& f) { SetFields(f / "cameras.txt", 1, {"LENS"}); }, 2,
       "LENS"},
      {"DuplicatePointId", kText,
       [](const fs::path& f) { RepeatRecord(f / "points3D.txt", 1); }, 2,
       "point"},
      {"DuplicateImageId", kText,
       [](const fs::path& f) { RepeatRecord(f / "images.txt", 2); }, 2,
       "image"},
      {"DuplicateCameraId", kText,
       [](const fs::path& f) { RepeatRecord(f / "cameras.txt", 1); }, 2,
       "camera"},
      {"NotANumberInAPoint", kText,
       [](const fs::path& f) { SetFields(f / "points3D.txt", 2, {"nan"}); }, 2,
       "nan"},
      {"NotANumberInACamera", kText,
       [](const fs::path& f) { SetFields(f / "cameras.txt", 4, {"nan"}); }, 2,
       "nan"},
      {"FocalLengthOfZero", kText,
       [](const fs::path& f) { SetFields(f / "cameras.txt", 4, {"0"}); }, 2,
       "found 0 for f of SIMPLE_RADIAL"},
      {"CameraIdThatStandsForNone", kText,
       [](const fs::path& f) {
         SetFields(f / "cameras.txt", 0, {"4294967295"});
       },
       2, "found id 4294967295, which in COLMAP stands for none"},
  };
}

std::vector<WrongModel> ModelsWithNothingToSolve() {
  return {
      {"NoPoints", kBinary,
       [](const fs::path& f) { Save(WithShortTracks(Load(f), 0), f); }, 3,
       "nothing to solve: the model has no observations"},
      {"TracksOfLengthOne", kBinary,
       [](const fs::path& f) { Save(WithShortTracks(Load(f), 1), f); }, 3,
       "nothing to solve: 60 observations left out (short_track 60)"},
      {"OneImage", kBinary,
       [](const fs::path& f) {
         SceneOptions options = SmallScene();
         options.num_frames = 2;
         options.track_length = 2;
         options.has_rigs = false;
         Model model = WithShortTracks(SynthesizeScene(options).model, 1);
         const ImageId only = model.track_elements.front().image_id;
         model.points3D.resize(1);
         model.track_elements.resize(1);
         model.images = {*std::find_if(
             model.images.begin(), model.images.end(),
             [only](const Image& image) { return image.id == only; })};
         for (Point2D& point2D : model.images.front().points2D) {
           if (point2D.point3D_id != model.points3D.front().id) {
             point2D.point3D_id = kInvalidPoint3DId;
           }
         }
         Save(model, f);
       },
       3, "nothing to solve: 1 observation left out (short_track 1)"},
  };
}

class SolverOnWrongModel : public ::testing::TestWithParam<WrongModel> {};

TEST_P(SolverOnWrongModel, SaysSoInOneSentenceAndWritesNothing) {
  TempFolder folder;
  Save(SmallLegacyModel(), folder / "input", GetParam().format);
  GetParam().damage(folder / "input");
  const Words before = FileNames(folder.path());

  const KrotResult result =
      RunKrot({"solver", "--input_path", folder / "input", "--output_path",
               folder / "output", "--report_path", folder / "report.json"});
  EXPECT_EQ(result.exit_code, GetParam().exit_code);
  EXPECT_THAT(result.err,
              IsOneSentence("krot solver", GetParam().part_of_sentence));
  EXPECT_EQ(result.out, "");
  EXPECT_EQ(FileNames(folder.path()), before);
}

TEST(TracksOfWhatIsNotThere, AreRefusedOnlyWhereTheyAreFollowed) {
  // An image, and a 2D point.
  for (const auto& [field, value] : {std::pair{8, "999"}, {9, "99999"}}) {
    SCOPED_TRACE(value);
    TempFolder folder;
    Save(SmallLegacyModel(), folder / "input", ModelFormat::kText);
    SetFields(folder / "input" / "points3D.txt", field, {value});
    const Words solve = {"solver", "--input_path", folder / "input",
                         "--output_path", folder / "output"};
    const KrotResult by_images = Succeeded(RunKrot(solve));
    EXPECT_THAT(by_images.err, HasSubstr("contradicts itself"));
    EXPECT_THAT(RunKrot(solve, {"--overwrite", "1", "--Model.on_contradiction",
                                "follow_tracks"}),
                IsRefused(2, "krot solver", value));
  }
}

// Poses alone, and points without tracks.
TEST(ModelsWithoutObservations, GetOneSentenceFromEveryCommand) {
  TempFolder folder;
  Model poses = WithShortTracks(SmallLegacyModel(), 0);
  Save(poses, folder / "poses");
  for (const Point3D& point : SmallLegacyModel().points3D) {
    poses.points3D.push_back({point.id, point.xyz, point.color, -1, 0, 0});
  }
  Save(poses, folder / "points");
  const std::string sentence =
      "the model has no observations (2D points that see 3D points); krot "
      "point_triangulator makes them from its poses and a database of matches";
  for (const char* name : {"poses", "points"}) {
    for (const Words& command : std::vector<Words>{
             {"solver"},
             {"point_triangulator"},
             {"bundle_adjuster"},
             {"outlier_filter", "--OutlierFilter.max_error", "4"},
             {"tolerance_analyzer", "--ToleranceAnalyzer.max_error", "4"}}) {
      Words paths = {"--input_path", folder / name};
      if (command[0] != "tolerance_analyzer") {
        paths = paths + Words{"--output_path", folder / "output"};
      }
      const KrotResult result = RunKrot(command, paths);
      EXPECT_EQ(result.exit_code, 3) << command[0];
      EXPECT_EQ(result.err, "krot " + command[0] +
                                ": nothing to solve: " + sentence + "\n");
    }
    const KrotResult shown =
        Succeeded(RunKrot({"model_analyzer", "--path", folder / name}));
    EXPECT_EQ(shown.err, "warning: " + sentence + "\n");
  }
}

// Dummy tracks, of which COLMAP's images know nothing.
TEST(ModelsWhoseTracksNameNo2DPoints, AreShownByTheAnalyzer) {
  TempFolder folder;
  Model model = SmallLegacyModel();
  for (Image& image : model.images) image.points2D.clear();
  Save(model, folder / "input");
  const KrotResult shown =
      Succeeded(RunKrot({"model_analyzer", "--path", folder / "input"}));
  EXPECT_THAT(shown.out, HasSubstr("Points: 60"));
}

std::string Name(const ::testing::TestParamInfo<WrongModel>& test) {
  return test.param.name;
}

INSTANTIATE_TEST_SUITE_P(Files, SolverOnWrongModel,
                         ::testing::ValuesIn(DamagedFiles()), Name);
INSTANTIATE_TEST_SUITE_P(Contents, SolverOnWrongModel,
                         ::testing::ValuesIn(InconsistentModels()), Name);
INSTANTIATE_TEST_SUITE_P(NothingToSolve, SolverOnWrongModel,
                         ::testing::ValuesIn(ModelsWithNothingToSolve()), Name);

}  // namespace
}  // namespace krot::internal
