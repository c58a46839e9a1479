#include "tools/krot/option_parser.h"

#include <optional>
#include <utility>

#include "tools/krot/given_options.h"
#include "tools/krot/same_path.h"

namespace krot::internal {
namespace {

constexpr char kProjectPath[] = "project_path";

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
  const std::vector<OptionAssignment> assignments = GivenOptions(
      arguments, options(),
      [this](const OptionAssignment& assignment) { Find(assignment); });
  Assign(assignments);
  for (const OptionAssignment& assignment : assignments) {
    if (assignment.name == kProjectPath) {
      Assign(ReadProjectFile(assignment.text, options()));
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

}  // namespace krot::internal
