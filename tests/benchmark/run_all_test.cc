// tools/benchmark/run_all.sh, on little: that every part goes through, that
// what fails is named, that docs/benchmarks.md and docs/history/benchmarks.md
// take up all that it leaves, and that compare_runs.sh tells two such runs
// apart.

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/benchmark/process.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

std::string TextOf(const fs::path& path) {
  std::ifstream stream(path);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

// One run serves all questions: it takes a while.
class RunAll : public testing::Test {
 protected:
  void SetUp() override {
    const std::string krot =
        (fs::path(KROT_BENCHMARK_EXECUTABLE).parent_path() / "krot").string();
    fs::create_directories(folder_ / "models/nothing");
    ASSERT_EQ(RunProcess({krot, "model_synthesizer", "--output_path",
                          folder_ / "models/small", "--Scene.num_frames", "8",
                          "--Scene.num_points", "400"})
                  .exit_code,
              0);
    // colmap, if there is one, is not found.
    ASSERT_EQ(RunProcess({"/bin/bash", "-c",
                          "cd \"$1\" && mkdir bin && ln -s $(which bash env "
                          "basename cat dirname mkdir mktemp mv rm sed tee) "
                          "bin && PATH=$1/bin QUICK=1 BUILD=$2 bash $3 models "
                          "output >out.txt 2>err.txt",
                          "bash", folder_ / "", fs::path(krot).parent_path(),
                          KROT_RUN_ALL})
                  .exit_code,
              0)
        << TextOf(folder_ / "err.txt");
  }

  std::string Output(const std::string& name) const {
    return TextOf(folder_ / ("output/" + name));
  }

  void ExpectTheTablesOfTheDocuments() const {
    std::set<std::string> left;
    for (const auto& entry : fs::directory_iterator(folder_ / "output")) {
      if (entry.path().extension() != ".md") continue;
      left.insert(entry.path().stem());
      EXPECT_THAT(TextOf(entry.path()), HasSubstr("|---")) << entry.path();
    }
    std::set<std::string> wanted;
    const fs::path documents = KROT_DOCUMENTS;
    const std::string document = TextOf(documents / "benchmarks.md") +
                                 TextOf(documents / "history/benchmarks.md");
    const std::regex begin("<!-- begin ([a-z_]+) -->");
    for (std::sregex_iterator it(document.begin(), document.end(), begin), end;
         it != end; ++it) {
      wanted.insert((*it)[1]);
      EXPECT_THAT(document,
                  HasSubstr("<!-- end " + std::string((*it)[1]) + " -->"));
    }
    EXPECT_EQ(left, wanted);
  }

  void ExpectALineForWhatIsLeftOut() const {
    const std::string err = TextOf(folder_ / "err.txt");
    EXPECT_THAT(err, HasSubstr("run_all.sh: models/nothing/ is left out: "));
    EXPECT_THAT(err, HasSubstr("run_all.sh: colmap is not there: "));
    EXPECT_THAT(Output("joint.md"), HasSubstr("| small |"));
  }

  void ExpectTheTimeOfEveryPart() const {
    const std::string out = TextOf(folder_ / "out.txt");
    for (const char* part : {"triangulation", "triangulation_inf", "blocks",
                             "known_rotation", "sweep", "scaling", "joint"}) {
      EXPECT_TRUE(std::regex_search(
          out, std::regex("\n" + std::string(part) + ": [0-9]+ s\n")))
          << part;
      EXPECT_THAT(Output("elapsed.md"), HasSubstr(std::string(part) + " | "));
    }
  }

  void ExpectTheAnswersAtTheEnd() const {
    const std::string out = TextOf(folder_ / "out.txt");
    EXPECT_THAT(out, HasSubstr(Output("summary.md")));
    EXPECT_THAT(Output("summary.md"), HasSubstr("fastest rival"));
  }

  // Of a run with itself, but for a sweep that took half of the time.
  void ExpectTheComparisonOfTwoRuns() const {
    const std::string command =
        "cd \"$1\" && cp -r output old && jq "
        "'.tables[].rows[].fast /= 2' output/sweep.json >old/sweep.json && "
        "bash $2 old output >compared.md";
    const fs::path script =
        fs::path(KROT_RUN_ALL).parent_path() / "compare_runs.sh";
    ASSERT_EQ(
        RunProcess({"/bin/bash", "-c", command, "bash", folder_ / "", script})
            .exit_code,
        0);
    const std::string compared = TextOf(folder_ / "compared.md");
    EXPECT_THAT(compared, HasSubstr("| sweep | fast | 1 | 2 | 2 | synthetic"));
    EXPECT_THAT(compared, HasSubstr("| blocks | Int fast | 1 | 1 | 1 | small"));
    EXPECT_THAT(compared, HasSubstr("| scaling | in all | "));
  }

  const ScratchFolder folder_;
};

TEST_F(RunAll, GoesThroughAndLeavesWhatTheDocumentsTakeUp) {
  ExpectTheTablesOfTheDocuments();
  ExpectALineForWhatIsLeftOut();
  ExpectTheTimeOfEveryPart();
  ExpectTheAnswersAtTheEnd();
  ExpectTheComparisonOfTwoRuns();
}

}  // namespace
}  // namespace krot::internal
