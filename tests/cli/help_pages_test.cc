#include <cstdio>
#include <fstream>
#include <memory>
#include <regex>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/cli/krot_process.h"

namespace krot::internal {
namespace {

Words Matches(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  Words matches;
  for (std::sregex_iterator it(text.begin(), text.end(), regex), end; it != end;
       ++it) {
    matches.push_back((*it)[1]);
  }
  return matches;
}

std::string OutputOf(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"),
                                                   &pclose);
  std::string output;
  for (int c; (c = std::fgetc(pipe.get())) != EOF;) {
    output += static_cast<char>(c);
  }
  return output;
}

// What the shell offers for the last of the words, which stand for a line.
std::string Completed(const std::string& words) {
  const TempFolder folder;
  const std::string path = (folder.path() / "krot.bash").string();
  std::ofstream(path) << RunKrot({"--help=bash"}).out << "COMP_WORDS=(" << words
                      << ")\n"
                      << "COMP_CWORD=$((${#COMP_WORDS[@]} - 1))\n"
                      << "_krot\necho \"${COMPREPLY[*]}\"\n";
  return OutputOf("bash " + path);
}

TEST(HelpPages, TheManualHoldsEveryOptionOfEveryCommand) {
  const std::string manual = RunKrot({"--help=man"}).out;
  const Words commands = Matches(manual, R"(\.BR krot\\-(\S+))");
  EXPECT_GE(commands.size(), 8);
  for (const std::string& command : commands) {
    const std::string page = RunKrot({command, "--help=man"}).out;
    const Words options =
        Matches(RunKrot({command, "--help"}).out, R"(\n  --([^\s,]+)\n)");
    EXPECT_GE(options.size(), 3) << command;
    for (const std::string& option : options) {
      EXPECT_THAT(page, HasSubstr("\\-\\-" + option + " "));
    }
  }
}

TEST(HelpPages, TheShellCompletesCommandsOptionsAndValues) {
  EXPECT_EQ(Completed("krot bundle"), "bundle_adjuster\n");
  EXPECT_EQ(Completed("krot help bundle"), "bundle_adjuster\n");
  EXPECT_EQ(Completed("krot solver --Solver.meth"), "--Solver.method\n");
  EXPECT_EQ(Completed("krot solver --Solver.method ''"),
            "auto res_int joint\n");
  EXPECT_EQ(Completed("krot solver --overwrite ''"), "0 1\n");
}

TEST(HelpPages, AFileIsLeftToTheShell) {
  EXPECT_EQ(Completed("krot solver --input_path ''"), "\n");
}

TEST(HelpPages, AnUnknownFormatIsRefused) {
  EXPECT_THAT(RunKrot({"solver", "--help=html"}),
              IsRefused(1, "krot solver", "--help = html"));
}

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
