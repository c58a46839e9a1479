#include <gtest/gtest.h>

#include "tests/cli/krot_process.h"

namespace krot::internal {
namespace {

TEST(Krot, PrintsItsVersion) {
  const KrotResult result = Succeeded(RunKrot({"--version"}));
  EXPECT_EQ(result.out, "krot " KROT_VERSION "\n");
}

TEST(Krot, ListsCommandsAndExitCodesWhenAskedForHelp) {
  const std::string help = RunKrot({"help"}).out;
  for (const char* command : {"solver", "point_triangulator", "model_analyzer",
                              "model_comparer", "model_synthesizer", "help",
                              "certificate was refused", "130  interrupted"}) {
    EXPECT_THAT(help, HasSubstr(command));
  }
  EXPECT_EQ(RunKrot({}).out, help);
  EXPECT_EQ(RunKrot({"-h"}).out, help);
  EXPECT_EQ(RunKrot({"--help"}).out, help);
}

TEST(Krot, ExplainsACommandInEitherManner) {
  const KrotResult result = Succeeded(RunKrot({"solver", "-h"}));
  EXPECT_EQ(result.err, "");
  EXPECT_THAT(result.out, HasSubstr("--Solver.norm"));
  EXPECT_EQ(RunKrot({"help", "solver"}).out, result.out);
  EXPECT_EQ(RunKrot({"solver", "--input_path", "a", "--help"}).out, result.out);
}

TEST(Krot, NamesTheNearestCommandForAnUnknownOne) {
  EXPECT_THAT(RunKrot({"slover"}),
              IsRefused(1, "krot", "did you mean solver?"));
  EXPECT_EQ(RunKrot({"help", "mapper"}).exit_code, 1);
  EXPECT_EQ(RunKrot({""}).exit_code, 1);
}

TEST(Krot, KeepsAnErrorOnOneLineWhateverTheUserTyped) {
  EXPECT_THAT(RunKrot({"two\nlines"}).err, IsOneSentence("krot", "two lines"));
}

}  // namespace
}  // namespace krot::internal
