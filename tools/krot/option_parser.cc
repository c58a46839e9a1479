#include "tools/krot/option_parser.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <utility>

#include <boost/program_options.hpp>

#include "tools/krot/same_path.h"

namespace krot {
namespace {

namespace po = boost::program_options;

constexpr char kProjectPath[] = "project_path";

po::options_description Describe(const std::vector<Option>& options) {
  po::options_description description;
  for (const Option& option : options) {
    description.add_options()(option.name.c_str(), po::value<std::string>());
  }
  return description;
}

OptionAssignment ToAssignment(const po::option& option) {
  const std::string text = option.value.empty() ? "" : option.value.front();
  if (option.position_key >= 0) {
    throw OptionError("unexpected argument '" + text +
                      "'; options read --name value");
  }
  const bool is_separate = option.original_tokens.size() > 1;
  if (is_separate && text.rfind("--", 0) == 0) {
    throw OptionError("--" + option.string_key + " has no value");
  }
  return {option.string_key, text, "--" + option.string_key};
}

}  // namespace

OptionParser::OptionParser(const std::string& command, std::string summary,
                           const std::string& program)
    : OptionTable(program + " " + command, std::move(summary),
                  program + " " + command + " -h") {}

void OptionParser::AddPath(const std::string& name, std::string* value,
                           bool required, const std::string& range,
                           const std::string& description) {
  Add({name, description, range, "", required,
       [value](const std::string& text) {
         *value = text;
         return !text.empty();
       }});
  paths_.push_back({name, value});
}

void OptionParser::AddOutputFile(const std::string& name, std::string* value,
                                 const std::string& description) {
  AddPath(name, value, false, "a file", description);
  paths_.back().is_output_file = true;
}

bool OptionParser::Parse(const std::vector<std::string>& arguments) {
  if (const std::optional<HelpFormat> asked = AskedHelp(arguments)) {
    help_format_ = *asked;
    return false;
  }
  const std::vector<OptionAssignment> assignments = ReadArguments(arguments);
  Assign(assignments);
  for (const OptionAssignment& assignment : assignments) {
    if (assignment.name == kProjectPath) {
      Assign(ReadProjectFile(assignment.text));
    }
  }
  RequireAll();
  CheckOutputFiles();
  if (on_parsed_) on_parsed_();
  return true;
}

std::string OptionParser::Help() const {
  switch (help_format_) {
    case HelpFormat::kText:
      return OptionTable::Help();
    case HelpFormat::kMan:
      return ManPage(*this);
    case HelpFormat::kBash:
      return BashCompletion(*this);
    case HelpFormat::kZsh:
      return ZshCompletion(*this);
  }
  return "";
}

void OptionParser::CheckOutputFiles() const {
  for (const PathOption& output : paths_) {
    if (!output.is_output_file) continue;
    for (const PathOption& other : paths_) {
      if (&other == &output || !IsSamePath(*output.value, *other.value)) {
        continue;
      }
      throw OptionError("--" + output.name + " = " + *output.value +
                        ", must not be --" + other.name);
    }
  }
}

std::vector<OptionAssignment> OptionParser::ReadArguments(
    const std::vector<std::string>& arguments) const {
  const po::options_description description = Describe(options());
  std::vector<OptionAssignment> assignments;
  try {
    const po::parsed_options parsed =
        po::command_line_parser(arguments)
            .options(description)
            .style(po::command_line_style::allow_long |
                   po::command_line_style::long_allow_next |
                   po::command_line_style::long_allow_adjacent)
            .allow_unregistered()
            .run();
    for (const po::option& option : parsed.options) {
      assignments.push_back(ToAssignment(option));
      Find(assignments.back());
    }
  } catch (const po::error& error) {
    throw OptionError(error.what());
  }
  return assignments;
}

std::vector<OptionAssignment> OptionParser::ReadProjectFile(
    const std::string& path) const {
  std::ifstream stream(path);
  std::error_code ignored;
  if (!stream || std::filesystem::is_directory(path, ignored)) {
    throw OptionError("--project_path = " + path +
                      ", must be a file that can be read");
  }
  const po::options_description description = Describe(options());
  std::vector<OptionAssignment> assignments;
  try {
    const po::parsed_options parsed =
        po::parse_config_file(stream, description, true);
    for (const po::option& option : parsed.options) {
      assignments.push_back({option.string_key,
                             option.value.empty() ? "" : option.value.front(),
                             option.string_key + " in " + path});
    }
  } catch (const po::error& error) {
    throw OptionError(path + ": " + error.what());
  }
  return assignments;
}

}  // namespace krot
