#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/cli/scenes.h"
#include "tests/testing/temp_folder.h"

// What a user sees on a terminal: krot runs on a pseudo-terminal, whose screen
// is kept here as a terminal keeps it.

namespace krot::internal {
namespace {

// All that arrives on a terminal of so many columns.
std::string Typescript(std::vector<std::string> arguments, int columns,
                       const char* term) {
  arguments.insert(arguments.begin(), KROT_EXECUTABLE);
  std::vector<char*> argv;
  for (std::string& word : arguments) argv.push_back(word.data());
  argv.push_back(nullptr);
  const winsize size = {1000, static_cast<unsigned short>(columns), 0, 0};
  int master = -1;
  const pid_t pid = forkpty(&master, nullptr, nullptr, &size);
  if (pid == 0) {
    setenv("TERM", term, 1);
    execv(argv[0], argv.data());
    _exit(127);
  }
  std::string text;
  char buffer[4096];
  for (ssize_t n = 0; (n = read(master, buffer, sizeof(buffer))) > 0;) {
    text.append(buffer, static_cast<size_t>(n));
  }
  close(master);
  int status = 0;
  waitpid(pid, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << text;
  return text;
}

// The rows that it leaves. Knows what KROT writes: printable ASCII, returns and
// new lines.
std::vector<std::string> Screen(const std::string& text, size_t columns) {
  std::vector<std::string> rows(1);
  size_t column = 0;
  for (size_t n = 0; n < text.size(); ++n) {
    if (text[n] == '\r') {
      column = 0;
    } else if (text[n] == '\n') {
      rows.emplace_back();
    } else {
      if (column == columns) {
        rows.emplace_back();
        column = 0;
      }
      rows.back().resize(std::max(rows.back().size(), column + 1), ' ');
      rows.back()[column++] = text[n];
    }
  }
  return rows;
}

// "sweep: cost" of "[###...] sweep 12: cost ...", "" of other rows.
std::string StageOf(const std::string& row) {
  static const std::regex kProgress(
      "^(\\[[#.]*\\] )?(sweep|iteration|finish|box) [0-9]+(: [a-z]*| of).*");
  std::smatch match;
  if (!std::regex_match(row, match, kProgress)) return "";
  return match[2].str() + match[3].str();
}

class Terminal : public ::testing::Test {
 protected:
  Terminal() {
    SceneOptions options = SmallScene();
    options.start_translation_noise = 0.02;
    options.start_point_noise = 0.02;
    Save(SynthesizeScene(options).model, folder_ / "input");
  }

  // Every command that shows progress.
  std::vector<std::vector<std::string>> Commands() const {
    const std::string input = folder_ / "input";
    const std::string output = folder_ / "output";
    const std::vector<std::string> paths = {
        "--input_path", input, "--output_path", output, "--overwrite", "1"};
    std::vector<std::vector<std::string>> commands = {
        {"solver"},
        {"solver", "--Solver.init", "feasible"},
        {"point_triangulator"},
        {"bundle_adjuster"},
        {"bundle_adjuster", "--BundleAdjustment.max_error_factor", "1.1"},
        {"outlier_filter", "--OutlierFilter.max_error", "3"}};
    for (std::vector<std::string>& command : commands) {
      command.insert(command.end(), paths.begin(), paths.end());
    }
    commands.push_back({"tolerance_analyzer", "--input_path", input,
                        "--ToleranceAnalyzer.max_error", "6"});
    return commands;
  }

  TempFolder folder_;
};

// One when it comes for the first time, and one when it is the last.
TEST_F(Terminal, KeepsTwoRowsOfAStageAtTheMostAtAnyWidth) {
  for (const int columns : {40, 60, 80, 200}) {
    for (const std::vector<std::string>& command : Commands()) {
      const std::string text = Typescript(command, columns, "xterm");
      std::string before;
      int num_rows = 0;
      for (const std::string& row :
           Screen(text, static_cast<size_t>(columns))) {
        const std::string stage = StageOf(row);
        num_rows = stage == before ? num_rows + 1 : 1;
        EXPECT_FALSE(!stage.empty() && num_rows > 2)
            << command[0] << " at " << columns << " columns:\n"
            << row;
        before = stage;
      }
      EXPECT_EQ(text.find('\033'), std::string::npos) << command[0];
    }
  }
}

TEST_F(Terminal, RewritesWithinItsWidth) {
  for (const int columns : {40, 60, 80, 200}) {
    for (const std::vector<std::string>& command : Commands()) {
      const std::string text = Typescript(command, columns, "xterm");
      // From a return that begins a rewriting to the next one's.
      const std::regex rewritten("\r([^\r\n]*)(?=\r(?!\n))");
      for (std::sregex_iterator it(text.begin(), text.end(), rewritten), end;
           it != end; ++it) {
        EXPECT_LT((*it)[1].length(), columns)
            << command[0] << ": " << it->str();
      }
    }
  }
}

TEST_F(Terminal, ThatIsDumbGetsPlainLines) {
  for (const std::vector<std::string>& command : Commands()) {
    const std::string text = Typescript(command, 80, "dumb");
    EXPECT_EQ(text.find('\033'), std::string::npos) << command[0];
    for (size_t n = 0; n + 1 < text.size(); ++n) {
      EXPECT_FALSE(text[n] == '\r' && text[n + 1] != '\n') << command[0];
    }
  }
}

}  // namespace
}  // namespace krot::internal
