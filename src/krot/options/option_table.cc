#include "krot/options/option_table.h"

#include <algorithm>
#include <set>
#include <sstream>
#include <utility>

namespace krot::internal {
namespace {

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

}  // namespace

OptionTable::OptionTable(std::string command, std::string summary,
                         std::string list)
    : command_(std::move(command)),
      summary_(std::move(summary)),
      list_(std::move(list)) {}

void OptionTable::Add(Option option) { options_.push_back(std::move(option)); }

void OptionTable::AddBool(const std::string& name, bool* value,
                          const std::string& description) {
  Add({name,
       description,
       "{0, 1}",
       *value ? "1" : "0",
       false,
       [value](const std::string& text) { return ParseBool(text, value); },
       false,
       {"0", "1"}});
}

void OptionTable::AddInteger(const std::string& name, int* value,
                             const Range<int>& range,
                             const std::string& description) {
  Add({name, description, "an integer " + range.text, std::to_string(*value),
       false, [value, contains = range.contains](const std::string& text) {
         return ParseInteger(text, value) && contains(*value);
       }});
}

void OptionTable::AddReal(const std::string& name, double* value,
                          const Range<double>& range,
                          const std::string& description) {
  Add({name, description, "a number " + range.text, NumberText(*value), false,
       [value, contains = range.contains](const std::string& text) {
         return ParseReal(text, value) && contains(*value);
       }});
}

void OptionTable::AddChoice(const std::string& name, std::string* value,
                            const std::vector<std::string>& choices,
                            const std::string& description) {
  Add({name, description, "one of " + ChoiceText(choices), *value, false,
       [value, choices](const std::string& text) {
         const auto choice = std::find_if(
             choices.begin(), choices.end(),
             [&](const std::string& c) { return IsSameWord(c, text); });
         if (choice != choices.end()) *value = *choice;
         return choice != choices.end();
       },
       false, choices});
}

void OptionTable::AddThreads(const std::string& name, int* value,
                             const std::string& remark) {
  Add({name, "Threads, -1 being all; " + remark,
       "-1 or an integer in [1, 1024]", "-1", false,
       [value](const std::string& text) {
         return ParseInteger(text, value) &&
                (*value == -1 || (*value >= 1 && *value <= 1024));
       }});
}

void OptionTable::Refuse(const std::string& name,
                         const std::string& why) const {
  if (!IsGiven(name)) return;
  throw OptionError("--" + name + " has no effect " + why);
}

void OptionTable::Assign(const std::vector<OptionAssignment>& assignments) {
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
  for (const OptionAssignment& assignment : assignments) {
    given_.emplace(assignment.name, assignment.text);  // the first stays
  }
}

void OptionTable::RequireAll() const {
  for (const Option& option : options_) {
    if (option.required && !IsGiven(option.name)) {
      throw OptionError("--" + option.name + " is required (" + list_ +
                        " lists the options)");
    }
  }
}

bool OptionTable::IsGiven(const std::string& name) const {
  return given_.count(name) > 0;
}

std::string OptionTable::Text(const std::string& name) const {
  const auto given = given_.find(name);
  if (given != given_.end()) return given->second;
  return Find({name, "", name}).default_text;
}

const Option& OptionTable::Find(const OptionAssignment& assignment) const {
  std::vector<std::string> names;
  for (const Option& option : options_) {
    if (option.name == assignment.name) return option;
    names.push_back(option.name);
  }
  std::string wanted = assignment.name;
  if (wanted == "import_path") wanted = "input_path";  // in COLMAP's old names
  if (wanted == "export_path") wanted = "output_path";
  const std::string nearest = NearestName(wanted, names);
  throw OptionError(assignment.source + " is no option of " + command_ +
                    (nearest.empty() ? " (" + list_ + " lists them)"
                                     : "; did you mean --" + nearest + "?"));
}

std::string OptionTable::Help() const {
  std::string text =
      Wrap(command_ + ": " + summary_, "") + "\nUsage:\n  " + command_;
  for (const Option& option : options_) {
    if (option.required) text += " --" + option.name + " VALUE";
  }
  text += " [options]\n\nOptions:\n";
  std::string without_effect;
  for (const Option& option : options_) {
    if (option.is_without_effect) {
      without_effect += (without_effect.empty() ? "" : ", ") + option.name;
      continue;
    }
    text += "  --" + option.name + '\n';
    text += Wrap(option.description + ".", "      ");
    std::string value = "Value: " + option.range + ".";
    if (option.required) value += " Required.";
    if (!option.default_text.empty()) {
      value += " Default: " + option.default_text + ".";
    }
    text += Wrap(value, "      ");
  }
  text += "  -h, --help\n      Print this text\n";
  return without_effect.empty()
             ? text
             : text + "\n" +
                   Wrap(
                       "COLMAP's options that are taken where they change "
                       "nothing here: " +
                           without_effect,
                       "");
}

}  // namespace krot::internal
