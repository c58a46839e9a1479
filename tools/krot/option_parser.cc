#include "tools/krot/option_parser.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
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

// `text` broken at spaces into lines of at most 80 columns, each indented.
std::string Wrap(const std::string& text, const std::string& indent) {
  std::istringstream words(text);
  std::string wrapped;
  std::string line = indent;
  for (std::string word; words >> word;) {
    if (line.size() > indent.size() && line.size() + 1 + word.size() > 80) {
      wrapped += line + '\n';
      line = indent;
    }
    line += (line.size() > indent.size() ? " " : "") + word;
  }
  return wrapped + line + '\n';
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
    : command_(program + " " + command), summary_(std::move(summary)) {}

void OptionParser::Add(Option option) { options_.push_back(std::move(option)); }

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

void OptionParser::AddBool(const std::string& name, bool* value,
                           const std::string& description) {
  Add({name, description, "{0, 1}", *value ? "1" : "0", false,
       [value](const std::string& text) { return ParseBool(text, value); }});
}

void OptionParser::AddInteger(const std::string& name, int* value,
                              const Range<int>& range,
                              const std::string& description) {
  Add({name, description, "an integer " + range.text, std::to_string(*value),
       false, [value, contains = range.contains](const std::string& text) {
         return ParseInteger(text, value) && contains(*value);
       }});
}

void OptionParser::AddReal(const std::string& name, double* value,
                           const Range<double>& range,
                           const std::string& description) {
  Add({name, description, "a number " + range.text, NumberText(*value), false,
       [value, contains = range.contains](const std::string& text) {
         return ParseReal(text, value) && contains(*value);
       }});
}

void OptionParser::AddChoice(const std::string& name, std::string* value,
                             const std::vector<std::string>& choices,
                             const std::string& description) {
  Add({name, description, "one of " + ChoiceText(choices), *value, false,
       [value, choices](const std::string& text) {
         *value = text;
         return std::find(choices.begin(), choices.end(), text) !=
                choices.end();
       }});
}

void OptionParser::AddThreads(const std::string& name, int* value,
                              const std::string& remark) {
  Add({name, "Threads, -1 being all; " + remark,
       "-1 or an integer in [1, 1024]", "-1", false,
       [value](const std::string& text) {
         return ParseInteger(text, value) &&
                (*value == -1 || (*value >= 1 && *value <= 1024));
       }});
}

void OptionParser::Refuse(const std::string& name,
                          const std::string& why) const {
  if (!IsGiven(name)) return;
  throw OptionError("--" + name + " has no effect " + why);
}

bool OptionParser::Parse(const std::vector<std::string>& arguments) {
  for (const std::string& argument : arguments) {
    if (argument == "-h" || argument == "--help") return false;
  }
  const std::vector<OptionAssignment> assignments = ReadArguments(arguments);
  Assign(assignments);
  for (const OptionAssignment& assignment : assignments) {
    if (assignment.name == kProjectPath) {
      Assign(ReadProjectFile(assignment.text));
    }
  }
  for (const Option& option : options_) {
    if (option.required && !IsGiven(option.name)) {
      throw OptionError("--" + option.name + " is required (" + command_ +
                        " -h lists the options)");
    }
  }
  CheckOutputFiles();
  return true;
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
  const po::options_description description = Describe(options_);
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
  const po::options_description description = Describe(options_);
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

void OptionParser::Assign(const std::vector<OptionAssignment>& assignments) {
  std::set<std::string> names;
  for (const OptionAssignment& assignment : assignments) {
    const Option& option = Find(assignment);
    if (!names.insert(option.name).second && !option.repeatable) {
      throw OptionError(assignment.source + " is given twice");
    }
    if (IsGiven(option.name)) continue;  // an explicit flag wins
    if (!option.parse(assignment.text)) {
      throw OptionError(assignment.source + " = " +
                        (assignment.text.empty() ? "''" : assignment.text) +
                        ", must be " + option.range);
    }
  }
  given_.insert(names.begin(), names.end());
}

bool OptionParser::IsGiven(const std::string& name) const {
  return given_.count(name) > 0;
}

const Option& OptionParser::Find(const OptionAssignment& assignment) const {
  std::vector<std::string> names;
  for (const Option& option : options_) {
    if (option.name == assignment.name) return option;
    names.push_back(option.name);
  }
  const std::string nearest = NearestName(assignment.name, names);
  throw OptionError(assignment.source + " is no option of " + command_ +
                    (nearest.empty() ? " (" + command_ + " -h lists them)"
                                     : "; did you mean --" + nearest + "?"));
}

std::string OptionParser::Help() const {
  std::string text =
      Wrap(command_ + ": " + summary_, "") + "\nUsage:\n  " + command_;
  for (const Option& option : options_) {
    if (option.required) text += " --" + option.name + " VALUE";
  }
  text += " [options]\n\nOptions:\n";
  for (const Option& option : options_) {
    text += "  --" + option.name + '\n';
    text += Wrap(option.description + ".", "      ");
    std::string value = "Value: " + option.range + ".";
    if (option.required) value += " Required.";
    if (!option.default_text.empty()) {
      value += " Default: " + option.default_text + ".";
    }
    text += Wrap(value, "      ");
  }
  return text + "  -h, --help\n      Print this text\n";
}

}  // namespace krot
