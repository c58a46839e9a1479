#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/cli/krot_process.h"

// docs/cli.md says of every option what --help says, no more and no less.

namespace krot::internal {
namespace {

// Option name -> "meaning | value | default".
using OptionTable = std::map<std::string, std::string>;

OptionTable ParseHelp(const std::string& help) {
  std::map<std::string, std::string> texts;
  std::istringstream lines(help);
  std::string name;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("  --", 0) == 0) {
      name = line.substr(2);
    } else if (line.rfind("      ", 0) == 0 && !name.empty()) {
      texts[name] += (texts[name].empty() ? "" : " ") + line.substr(6);
    } else {
      name.clear();
    }
  }
  const std::regex pattern(
      R"((.*)\. Value: (.*?)\.(?: (Required)\.)?(?: Default: (.*)\.)?)");
  OptionTable table;
  for (const auto& [option, text] : texts) {
    std::smatch match;
    if (!std::regex_match(text, match, pattern)) {
      ADD_FAILURE() << option << ": " << text;
      continue;
    }
    table[option] = match[1].str() + " | " + match[2].str() + " | " +
                    (match[3].matched ? "required" : match[4].str());
  }
  return table;
}

// What stands below "## heading".
std::string Section(const std::string& document, const std::string& heading) {
  const size_t begin = document.find("\n## " + heading + "\n");
  if (begin == std::string::npos) return "";
  return document.substr(begin, document.find("\n## ", begin + 1) - begin);
}

// The rows "| `--name` | meaning | value | default |".
OptionTable ParseRows(const std::string& section) {
  OptionTable table;
  std::istringstream lines(section);
  const std::regex row(R"(\| `(--[^`]*)` \| (.*) \|)");
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (std::regex_match(line, match, row)) table[match[1]] = match[2];
  }
  return table;
}

// The rows below "## `command`", those of every command, and those of several
// commands that a paragraph of the command's section names.
OptionTable ParseDocument(const std::string& document,
                          const std::string& command) {
  const std::string section = Section(document, "`" + command + "`");
  OptionTable table = ParseRows(section);
  table.merge(ParseRows(Section(document, "Options of every command")));
  const OptionTable shared =
      ParseRows(Section(document, "Options of several commands"));
  const size_t begin = section.find("\nOptions of [several commands]");
  if (begin == std::string::npos) return table;
  const std::string names =
      section.substr(begin, section.find("\n\n", begin) - begin);
  const std::regex name("`(--[^`]*)`");
  for (std::sregex_iterator it(names.begin(), names.end(), name), end;
       it != end; ++it) {
    table[(*it)[1]] = shared.at((*it)[1]);
  }
  return table;
}

class Documentation : public ::testing::TestWithParam<const char*> {};

TEST_P(Documentation, SaysWhatHelpSays) {
  const std::string command = GetParam();
  const OptionTable help = ParseHelp(RunKrot({command, "--help"}).out);
  EXPECT_GE(help.size(), 6u);
  EXPECT_EQ(ParseDocument(ReadBytes(KROT_CLI_DOCUMENT), command), help);
}

INSTANTIATE_TEST_SUITE_P(
    Commands, Documentation,
    ::testing::Values("solver", "point_triangulator", "bundle_adjuster",
                      "outlier_filter", "model_checker", "tolerance_analyzer",
                      "model_analyzer", "model_comparer", "certificate_checker",
                      "model_synthesizer"),
    [](const auto& test) { return std::string(test.param); });

TEST(DocumentationOfKrot, ListsTheExitCodesOfHelp) {
  const std::string document = ReadBytes(KROT_CLI_DOCUMENT);
  std::istringstream help(RunKrot({"help"}).out);
  const std::regex exit_code(R"(\s+(\d+)  (.*))");
  int num_codes = 0;
  for (std::string line; std::getline(help, line);) {
    std::smatch match;
    if (!std::regex_match(line, match, exit_code)) continue;
    ++num_codes;
    EXPECT_NE(document.find("| " + match[1].str() + " | " + match[2].str()),
              std::string::npos)
        << line;
  }
  EXPECT_EQ(num_codes, 13);
}

}  // namespace
}  // namespace krot::internal
