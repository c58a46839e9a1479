#include "krot/model/model_io.h"

#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr ModelFormat kFormats[] = {ModelFormat::kBinary, ModelFormat::kText};

void Write(const Model& model, const fs::path& folder,
           ModelFormat format = ModelFormat::kBinary) {
  WriteModelOptions options;
  options.format = format;
  options.overwrite = true;
  WriteModel(model, folder, options);
}

std::string DetectionError(const fs::path& folder) {
  return ModelErrorOf([&] { DetectModelFormat(folder); });
}

std::string ReadingError(const fs::path& folder) {
  return ModelErrorOf([&] { ReadModel(folder, DetectModelFormat(folder)); });
}

// Both functions must agree about what can be written.
std::string WritingError(const fs::path& folder) {
  const WriteModelOptions options;
  const std::string error =
      WriteErrorOf([&] { CheckWritable(folder, options); });
  EXPECT_EQ(WriteErrorOf([&] { WriteModel(TinyModel(), folder, options); }),
            error);
  return error;
}

TEST(ModelIo, ReadsBackWhatItWroteInEitherFormat) {
  const TempFolder folder;
  for (const Model& model : {TinyModel(), TinyRigModel(), Model()}) {
    for (const ModelFormat format : kFormats) {
      Write(model, folder / "model", format);
      EXPECT_EQ(DetectModelFormat(folder / "model"), format);
      EXPECT_THAT(ReadModel(folder / "model", format), IsModel(model));
    }
  }
}

TEST(ModelIo, WritesRigsAndFramesOnlyIfThereAreAny) {
  const TempFolder folder;
  Write(TinyRigModel(), folder / "model");
  EXPECT_THAT(FileNames(folder / "model"),
              ElementsAre("cameras.bin", "frames.bin", "images.bin",
                          "points3D.bin", "rigs.bin"));
  Write(TinyModel(), folder / "model");
  EXPECT_THAT(FileNames(folder / "model"),
              ElementsAre("cameras.bin", "images.bin", "points3D.bin"));
}

TEST(ModelIo, GivesALegacyModelARigPerCameraAndAFramePerImage) {
  const TempFolder folder;
  Write(TinyModel(), folder / "model");
  const Model model = ReadModel(folder / "model", ModelFormat::kBinary);
  EXPECT_FALSE(model.stores_rigs);
  ASSERT_EQ(model.rigs.size(), model.cameras.size());
  for (size_t r = 0; r < model.rigs.size(); ++r) {
    const SensorId camera{kSensorTypeCamera, model.cameras[r].id};
    EXPECT_EQ(model.rigs[r].id, camera.id);
    EXPECT_TRUE(model.rigs[r].ref_sensor_id == camera);
    EXPECT_THAT(model.rigs[r].sensors, IsEmpty());
  }
  ASSERT_EQ(model.frames.size(), model.images.size());
  for (size_t f = 0; f < model.frames.size(); ++f) {
    const Frame& frame = model.frames[f];
    const Image& image = model.images[f];
    EXPECT_EQ(frame.id, image.id);
    EXPECT_EQ(frame.rig_id, image.camera_id);
    EXPECT_EQ(frame.rig_from_world.quaternion_wxyz,
              image.cam_from_world.quaternion_wxyz);
    ASSERT_EQ(frame.data.size(), 1u);
    EXPECT_EQ(frame.data[0].sensor_id.id, image.camera_id);
    EXPECT_EQ(frame.data[0].data_id, image.id);
  }
}

TEST(ModelIo, TakesEmptyRigsAndFramesForALegacyModel) {
  const TempFolder folder;
  Write(TinyModel(), folder / "model");
  WriteBytes(folder / "model/rigs.bin", std::string(8, '\0'));
  WriteBytes(folder / "model/frames.bin", std::string(8, '\0'));
  EXPECT_THAT(ReadModel(folder / "model", ModelFormat::kBinary),
              IsModel(TinyModel()));
}

TEST(ModelIo, PrefersBinaryAsColmapDoes) {
  const TempFolder folder;
  Write(TinyModel(), folder / "text", ModelFormat::kText);
  Write(TinyModel(), folder / "model", ModelFormat::kBinary);
  for (const char* name : {"cameras.txt", "images.txt", "points3D.txt"}) {
    fs::copy_file(folder / "text" / name, folder / "model" / name);
  }
  EXPECT_EQ(DetectModelFormat(folder / "model"), ModelFormat::kBinary);
  fs::remove(folder / "model/images.bin");
  EXPECT_EQ(DetectModelFormat(folder / "model"), ModelFormat::kText);
}

TEST(ModelIo, SaysWhatAFolderLacks) {
  const TempFolder folder;
  EXPECT_THAT(DetectionError(folder / "none"), HasSubstr("no such folder"));
  EXPECT_THAT(DetectionError(folder.path()),
              HasSubstr("found no model file, expected cameras, images and "
                        "points3D"));
  WriteBytes(folder / "file", "");
  EXPECT_THAT(DetectionError(folder / "file"), HasSubstr("is a file"));
  Write(TinyModel(), folder / "model", ModelFormat::kText);
  fs::remove(folder / "model/images.txt");
  EXPECT_THAT(DetectionError(folder / "model"),
              HasSubstr("found cameras.txt, points3D.txt, expected images.txt "
                        "too"));
}

TEST(ModelIo, PointsToTheSubfolderThatHoldsTheModel) {
  const TempFolder folder;
  Write(TinyModel(), folder / "sparse/0");
  EXPECT_THAT(DetectionError(folder / "sparse"),
              HasSubstr("sparse/0 holds a model"));
  EXPECT_THAT(DetectionError(folder.path()),
              HasSubstr("sparse/0 holds a model"));
}

TEST(ModelIo, RefusesRigsWithoutFramesAndFramesWithoutRigs) {
  const TempFolder folder;
  for (const ModelFormat format : kFormats) {
    Write(TinyRigModel(), folder / "model", format);
    const std::string end = format == ModelFormat::kBinary ? ".bin" : ".txt";
    fs::rename(folder / ("model/rigs" + end), folder / "aside");
    EXPECT_THAT(ReadingError(folder / "model"),
                HasSubstr("found frames" + end + " without rigs" + end));
    fs::remove(folder / ("model/frames" + end));
    fs::rename(folder / "aside", folder / ("model/rigs" + end));
    EXPECT_THAT(ReadingError(folder / "model"),
                HasSubstr("found rigs" + end + " without frames" + end));
  }
}

TEST(ModelIo, RecognisesGitLfsPointers) {
  const TempFolder folder;
  Write(TinyModel(), folder / "model");
  WriteBytes(folder / "model/images.bin",
             "version https://git-lfs.github.com/spec/v1\n"
             "oid sha256:0000\nsize 12\n");
  EXPECT_THAT(ReadingError(folder / "model"),
              AllOf(HasSubstr("images.bin"), HasSubstr("Git LFS pointer"),
                    HasSubstr("git lfs pull")));
}

TEST(ModelIo, NamesTheFileThatCannotBeRead) {
  const TempFolder folder;
  Write(TinyModel(), folder / "model");
  fs::remove(folder / "model/images.bin");
  EXPECT_THAT(
      ModelErrorOf([&] { ReadModel(folder / "model", ModelFormat::kBinary); }),
      AllOf(HasSubstr("images.bin: cannot be opened: No such file")));
  fs::create_directory(folder / "model/images.bin");
  EXPECT_THAT(ReadingError(folder / "model"),
              HasSubstr("images.bin: not a regular file"));
}

TEST(ModelIo, ReplacesAModelOnlyIfAskedTo) {
  const TempFolder folder;
  WriteModel(TinyModel(), folder / "model", WriteModelOptions());
  EXPECT_THAT(WritingError(folder / "model"),
              HasSubstr("already holds a model (cameras.bin)"));
  fs::remove(folder / "model/cameras.bin");
  EXPECT_THAT(WritingError(folder / "model"),
              HasSubstr("already holds a model"));
  Write(TinyRigModel(), folder / "model");
  EXPECT_THAT(ReadModel(folder / "model", ModelFormat::kBinary),
              IsModel(TinyRigModel()));
}

TEST(ModelIo, CarriesForeignFilesOverButNoOtherModelFiles) {
  const TempFolder folder;
  Write(TinyRigModel(), folder / "model", ModelFormat::kBinary);
  WriteBytes(folder / "model/notes.md", "mine");
  WriteBytes(folder / "model/deep/er/file", "too");
  fs::create_symlink("nowhere", folder / "model/link");
  Write(TinyModel(), folder / "model", ModelFormat::kText);
  EXPECT_THAT(FileNames(folder / "model"),
              ElementsAre("cameras.txt", "deep", "images.txt", "link",
                          "notes.md", "points3D.txt"));
  EXPECT_EQ(ReadBytes(folder / "model/notes.md"), "mine");
  EXPECT_EQ(ReadBytes(folder / "model/deep/er/file"), "too");
  EXPECT_EQ(fs::read_symlink(folder / "model/link"), "nowhere");
  EXPECT_THAT(FileNames(folder.path()), ElementsAre("model"));
}

TEST(ModelIo, KeepsTheFoldersPermissions) {
  const TempFolder folder;
  Write(TinyModel(), folder / "model");
  const fs::perms perms = fs::perms::owner_all | fs::perms::group_exec;
  fs::permissions(folder / "model", perms);
  Write(TinyModel(), folder / "model");
  EXPECT_EQ(fs::status(folder / "model").permissions(), perms);
}

TEST(ModelIo, CopiesTheProjectFile) {
  const TempFolder folder;
  WriteBytes(folder / "input/project.ini", "new");
  WriteBytes(folder / "input/images.zip", "not copied");
  WriteBytes(folder / "output/project.ini", "old");
  WriteModelOptions options;
  options.copy_project_from = folder / "input";
  WriteModel(TinyModel(), folder / "output", options);
  EXPECT_THAT(
      FileNames(folder / "output"),
      ElementsAre("cameras.bin", "images.bin", "points3D.bin", "project.ini"));
  EXPECT_EQ(ReadBytes(folder / "output/project.ini"), "new");
}

TEST(ModelIo, WritesThroughASymbolicLinkToTheFolder) {
  const TempFolder folder;
  fs::create_directory(folder / "real");
  fs::create_directory_symlink(folder / "real", folder / "link");
  Write(TinyModel(), folder / "link/");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_THAT(ReadModel(folder / "real", ModelFormat::kBinary),
              IsModel(TinyModel()));
}

TEST(ModelIo, RefusesFoldersThatCannotBeCreatedOrReplaced) {
  const TempFolder folder;
  WriteBytes(folder / "file", "");
  EXPECT_THAT(WritingError(folder / "file"), HasSubstr("is a file"));
  EXPECT_THAT(WritingError(folder / "file/below"), HasSubstr("is a file"));
  EXPECT_THAT(WritingError("/proc"), HasSubstr("is a mount point"));
  EXPECT_THAT(WritingError(fs::current_path()), HasSubstr("working directory"));
  EXPECT_THAT(WritingError(""), HasSubstr("no name of an output folder"));
  EXPECT_THAT(FileNames(folder.path()), ElementsAre("file"));
}

// Root may read and write everywhere: for as long as this lives it is nobody,
// whom the folder belongs to.
class WithoutRoot {
 public:
  explicit WithoutRoot(const fs::path& folder) : is_root_(::geteuid() == 0) {
    if (!is_root_) return;
    constexpr uid_t kNobody = 65534;
    EXPECT_EQ(::chown(folder.c_str(), kNobody, kNobody), 0);
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      EXPECT_EQ(::chown(entry.path().c_str(), kNobody, kNobody), 0);
    }
    EXPECT_EQ(::setresuid(kNobody, kNobody, 0), 0);
  }
  ~WithoutRoot() {
    if (is_root_) {
      EXPECT_EQ(::setresuid(0, 0, 0), 0);
    }
  }

 private:
  const bool is_root_;
};

TEST(ModelIo, RefusesFoldersWithoutWritePermission) {
  const TempFolder folder;
  fs::create_directories(folder / "parent/model");
  const WithoutRoot without_root(folder.path());
  fs::permissions(folder / "parent",
                  fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_THAT(WritingError(folder / "parent/new"),
              HasSubstr("cannot be written to: Permission denied"));
  EXPECT_THAT(WritingError(folder / "parent/model"),
              HasSubstr("cannot be written to: Permission denied"));
  fs::permissions(folder / "parent", fs::perms::owner_all);
}

TEST(ModelIo, RefusesFoldersWithoutReadPermission) {
  const TempFolder folder;
  Write(TinyModel(), folder / "model");
  const WithoutRoot without_root(folder.path());
  fs::permissions(folder / "model", fs::perms::owner_read);
  EXPECT_THAT(DetectionError(folder / "model"),
              HasSubstr("cannot be read: Permission denied"));
  fs::permissions(folder / "model", fs::perms::owner_all);
}

TEST(ModelIo, ChangesNothingWhenItOnlyChecks) {
  const TempFolder folder;
  CheckWritable(folder / "a/b/c", WriteModelOptions());
  EXPECT_THAT(FileNames(folder.path()), IsEmpty());
}

TEST(ModelIo, LeavesTheOldModelAndNoTracesIfWritingFails) {
  const TempFolder folder;
  Write(TinyModel(), folder / "model");
  Model unwritable = TinyModel();
  unwritable.images[0].name = "not\ntext";
  for (const char* target : {"model", "new/deep"}) {
    EXPECT_THAT(WriteErrorOf([&] {
                  Write(unwritable, folder / target, ModelFormat::kText);
                }),
                HasSubstr("found the name"));
  }
  EXPECT_THAT(ReadModel(folder / "model", ModelFormat::kBinary),
              IsModel(TinyModel()));
  EXPECT_THAT(FileNames(folder.path()), ElementsAre("model"));
}

// A process that keeps replacing one model by another is killed at any time:
// the folder always holds one of the two.
TEST(ModelIo, LeavesOneOfTheTwoModelsIfKilled) {
  const TempFolder folder;
  const Model legacy = TinyModel();
  const Model rigs = TinyRigModel();
  Write(legacy, folder / "model", ModelFormat::kText);
  WriteBytes(folder / "model/notes.md", "mine");
  for (int kill = 0; kill < 20; ++kill) {
    const pid_t child = ::fork();
    if (child == 0) {
      for (;;) {
        Write(rigs, folder / "model", ModelFormat::kBinary);
        Write(legacy, folder / "model", ModelFormat::kText);
      }
    }
    std::this_thread::sleep_for(std::chrono::microseconds(3000 + 977 * kill));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);

    const ModelFormat format = DetectModelFormat(folder / "model");
    EXPECT_THAT(ReadModel(folder / "model", format),
                IsModel(format == ModelFormat::kText ? legacy : rigs));
    EXPECT_EQ(ReadBytes(folder / "model/notes.md"), "mine");
  }
}

TEST(ModelIo, ListsNamesThatColmapsTextReaderWouldCut) {
  EXPECT_THAT(ImageNamesWithWhiteSpace(TinyModel()),
              ElementsAre("left/a b.jpg"));
}

}  // namespace
}  // namespace krot::internal
