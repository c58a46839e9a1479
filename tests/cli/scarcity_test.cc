#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"
#include "tests/testing/sanitizer.h"

namespace krot::internal {
namespace {

constexpr uint64_t kMegabyte = 1000000;

// A machine with too little of something. Sanitizers need more address space
// than there is memory, so that it cannot be bounded.
class Scarcity : public ::testing::Test {
 protected:
  void SetUp() override {
    if (kIsSanitized) {
      GTEST_SKIP() << "the address space cannot be bounded under a sanitizer";
    }
  }

  TempFolder folder_;
};

TEST_F(Scarcity, OfMemoryEndsWithASentence) {
  SceneOptions options = SmallScene();
  options.num_points = 200000;
  Save(SynthesizeScene(options).model, folder_ / "input");
  EXPECT_THAT(
      KrotProcess({"solver", "--input_path", folder_ / "input", "--output_path",
                   folder_ / "output", "--log_level", "0"},
                  100 * kMegabyte)
          .Wait(),
      IsRefused(6, "krot solver", "out of memory"));
  EXPECT_EQ(FileNames(folder_.path()), Words{"input"});
}

TEST_F(Scarcity, OfWhatASolveNeedsIsSeenBeforeItBegins) {
  SceneOptions options = SmallScene();
  options.num_points = 120000;
  Save(SynthesizeScene(options).model, folder_ / "input");
  // Between what reading takes, 190 MB, and what solving does, 360. One thread,
  // as the stacks of all cores of a large machine would already take the rest.
  const KrotResult result =
      KrotProcess({"solver", "--input_path", folder_ / "input", "--output_path",
                   folder_ / "output", "--Solver.init", "feasible",
                   "--Solver.method", "joint", "--Solver.num_threads", "1"},
                  270 * kMegabyte)
          .Wait();
  EXPECT_EQ(result.exit_code, 6);
  EXPECT_THAT(result.err, HasSubstr("out of memory before it began"));
  EXPECT_THAT(result.err, HasSubstr(" are free"));
  EXPECT_EQ(FileNames(folder_.path()), Words{"input"});
}

TEST_F(Scarcity, OfThreadsChangesNothing) {
  SceneOptions options = SmallScene();
  options.num_points = 1000;
  Save(SynthesizeScene(options).model, folder_ / "input");
  const auto solve = [&](const std::string& output, const std::string& threads,
                         uint64_t max_memory_bytes) {
    Succeeded(
        KrotProcess({"solver", "--input_path", folder_ / "input",
                     "--output_path", folder_ / output, "--ResInt.max_sweeps",
                     "2", "--Solver.num_threads", threads},
                    max_memory_bytes)
            .Wait());
    return ReadBytes(folder_ / output / "points3D.bin");
  };
  // The stacks alone of 1000 threads would take 8 GB.
  EXPECT_EQ(solve("many", "1000", 100 * kMegabyte), solve("one", "1", 0));
}

// "about 81.0 MB will be needed" on stderr, in bytes.
double AnnouncedBytes(const std::string& err) {
  const size_t begin = err.find("about ") + 6;
  std::istringstream text(err.substr(begin));
  double value = 0;
  std::string unit;
  text >> value >> unit;
  EXPECT_EQ(unit, "MB") << err;
  return 1e6 * value;
}

TEST_F(Scarcity, IsAnnouncedToThirtyPercent) {
  SceneOptions options = SmallScene();
  options.num_frames = 30;
  options.num_points = 20000;
  options.pixel_noise = 0.5;
  Save(SynthesizeScene(options).model, folder_ / "input");
  for (const char* method : {"auto", "joint", "res_int"}) {
    SCOPED_TRACE(method);
    const KrotResult result = Succeeded(
        RunKrot({"solver", "--input_path", folder_ / "input", "--output_path",
                 folder_ / "output", "--overwrite", "1", "--report_path",
                 folder_ / "report.json", "--Solver.method", method}));
    const double peak = ReadJson(folder_ / "report.json")["peak_memory_bytes"];
    EXPECT_NEAR(AnnouncedBytes(result.err), peak, 0.3 * peak);
  }
}

}  // namespace
}  // namespace krot::internal
