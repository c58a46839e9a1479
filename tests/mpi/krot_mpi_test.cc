#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <iostream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/base/context.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

// `mpirun -n N krot_mpi solver` beside `krot solver`: the same files.

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

std::string BytesOf(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream bytes;
  bytes << stream.rdbuf();
  return bytes.str();
}

// Every file of a folder, one after another.
std::string BytesOfModel(const fs::path& folder) {
  std::string bytes;
  for (const char* name : {"cameras", "rigs", "frames", "images", "points3D"}) {
    bytes += BytesOf(folder / (std::string(name) + ".bin"));
    bytes += BytesOf(folder / (std::string(name) + ".txt"));
  }
  return bytes;
}

struct MpiResult {
  int exit_code = 0;
  std::string err;
};

class KrotMpi : public ::testing::Test {
 protected:
  // What kills a rank of the run that it is the prefix of: its own process is
  // found by its environment's name for it.
  std::string KillLater(double seconds, int rank) const {
    return "(sleep " + std::to_string(seconds) + "; for p in $(pgrep -f -- '" +
           (folder_ / "out").string() +
           "'); do tr '\\0' '\\n' < /proc/$p/environ 2> /dev/null | grep -q "
           "'^OMPI_COMM_WORLD_RANK=" +
           std::to_string(rank) +
           "$' && kill -9 $p; done) & trap \"kill $! 2> /dev/null\" EXIT;";
  }

  // In a shell, so that `prefix` may end it early.
  MpiResult Run(int count, const std::string& arguments,
                const std::string& prefix = "") const {
    const fs::path err = folder_ / "err.txt";
    const std::string command =
        prefix + " " KROT_MPIRUN " -n " + std::to_string(count) +
        " --oversubscribe --allow-run-as-root " KROT_MPI_EXECUTABLE " " +
        arguments + " > " + (folder_ / "out.txt").string() + " 2> " +
        err.string() + " < /dev/null";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, BytesOf(err)};
  }

  void ExpectSameFiles(const fs::path& input,
                       const std::vector<int>& counts) const {
    const KrotResult alone =
        RunKrot({"solver", "--input_path", input.string(), "--output_path",
                 folder_ / "alone", "--certificate_path",
                 folder_ / "alone.json", "--overwrite", "1"});
    ASSERT_EQ(alone.exit_code, 0) << alone.err;
    for (const int count : counts) {
      SCOPED_TRACE(input.string() + ", " + std::to_string(count) + " ranks");
      const MpiResult result =
          Run(count, "solver --overwrite 1 --input_path " + input.string() +
                         " --output_path " + (folder_ / "ranks").string() +
                         " --certificate_path " +
                         (folder_ / "ranks.json").string());
      ASSERT_EQ(result.exit_code, 0) << result.err;
      EXPECT_TRUE(BytesOfModel(folder_ / "ranks") ==
                  BytesOfModel(folder_ / "alone"));
      EXPECT_TRUE(BytesOf(folder_ / "ranks.json") ==
                  BytesOf(folder_ / "alone.json"));
    }
  }

  TempFolder folder_;
};

TEST_F(KrotMpi, WritesWhatOneProcessDoes) {
  ExpectSameFiles(KROT_SAMPLE "/model", {1, 2, 3, 4});
}

TEST_F(KrotMpi, WritesWhatOneProcessDoesOfRealModels) {
  if (!RealModels()) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  for (const char* name :
       {"crane8_txt", "maupertuis4_txt", "two_cameras44", "fold19",
        "task41_rigs_frames", "gbk_names11", "wide17", "south128",
        "strong_gazebo111", "longtracks92"}) {
    ExpectSameFiles(*RealModels() / name, {2, 4});
  }
}

// Which only the whole model tells.
TEST_F(KrotMpi, WritesWhatOneProcessDoesOfAModelThatContradictsItself) {
  Model model = SynthesizeScene(SmallScene()).model;
  for (Point2D& point2D : model.images[1].points2D) {
    if (point2D.point3D_id % 7 == 0) point2D.point3D_id = kInvalidPoint3DId;
  }
  Save(model, folder_ / "in");
  ExpectSameFiles(folder_ / "in", {2, 3});
}

TEST_F(KrotMpi, RefusesInOneSentenceWhatIsForOneProcess) {
  Save(SynthesizeScene(SmallScene()).model, folder_ / "in");
  const MpiResult result =
      Run(2, "solver --Solver.init feasible --input_path " +
                 (folder_ / "in").string() + " --output_path " +
                 (folder_ / "out").string());
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("krot_mpi: a start from nothing is for one "
                                    "process: use krot solver\n"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST_F(KrotMpi, SaysOnceWhatIsWrongWithAModel) {
  fs::create_directory(folder_ / "in");
  const MpiResult result =
      Run(3, "solver --input_path " + (folder_ / "in").string() +
                 " --output_path " + (folder_ / "out").string());
  EXPECT_EQ(result.exit_code, 2);
  size_t sentences = 0;
  for (size_t at = result.err.find("krot_mpi: "); at != std::string::npos;
       at = result.err.find("krot_mpi: ", at + 1)) {
    ++sentences;
  }
  EXPECT_EQ(sentences, 1u) << result.err;
}

// One of its ranks, at an instant that no one chose; KROT_KILLS for more of
// them. What goes on behind the steps that were done, by however many, ends as
// an undisturbed run does.
TEST_F(KrotMpi, KilledLeavesTheOldModelOrTheNewAndGoesOn) {
  const char* kills = std::getenv("KROT_KILLS");
  const int num_kills = kills == nullptr ? 10 : std::atoi(kills);
  SceneOptions scene = SmallScene();
  scene.layout = SceneLayout::kStreet;
  scene.num_frames = 40;
  scene.num_points = 10000;
  const Model old_model = SynthesizeScene(SmallScene()).model;
  Save(SynthesizeScene(scene).model, folder_ / "in");
  ExpectSameFiles(folder_ / "in", {2});
  const std::string whole = BytesOfModel(folder_ / "alone");
  Save(old_model, folder_ / "old");
  const std::string old = BytesOfModel(folder_ / "old");
  std::mt19937 random(18);
  const std::string arguments =
      "solver --overwrite 1 --input_path " + (folder_ / "in").string() +
      " --output_path " + (folder_ / "out").string() + " --checkpoint_path " +
      (folder_ / "steps").string();
  const Timer timer;
  ASSERT_EQ(Run(3, arguments).exit_code, 0);
  const double undisturbed = timer.Seconds();
  int num_killed = 0;
  int num_gone_on = 0;
  for (int n = 0; n < num_kills; ++n) {
    fs::remove_all(folder_ / "out");
    Save(old_model, folder_ / "out");
    const double seconds =
        std::uniform_real_distribution<double>(0.1, 1)(random) * undisturbed;
    const MpiResult killed =
        Run(3, arguments, KillLater(seconds, static_cast<int>(random() % 3)));
    const std::string bytes = BytesOfModel(folder_ / "out");
    EXPECT_TRUE(bytes == old || bytes == whole) << seconds << " s";
    num_killed += killed.exit_code != 0;
    const MpiResult again = Run(1 + n % 4, arguments);
    EXPECT_EQ(again.exit_code, 0) << again.err;
    EXPECT_TRUE(BytesOfModel(folder_ / "out") == whole) << seconds << " s";
    EXPECT_FALSE(fs::exists(folder_ / "steps"));
    num_gone_on += again.err.find("going on behind") != std::string::npos;
  }
  std::cout << num_killed << " runs were killed, " << num_gone_on
            << " went on behind steps\n";
}

}  // namespace
}  // namespace krot::internal
