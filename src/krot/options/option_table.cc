#include "krot/options/option_table.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numeric>
#include <set>
#include <sstream>
#include <utility>

#include "krot/base/numbers.h"

namespace krot::internal {
namespace {

template <typename Number>
bool ParseInto(const std::string& text, Number* value) {
  const std::optional<Number> parsed = ParseNumber<Number>(text);
  if (parsed) *value = *parsed;
  return parsed.has_value();
}

std::string LowerCase(std::string text) {
  for (char& c : text) {
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return text;
}

// The number of insertions, deletions and replacements that turn a into b
// (Levenshtein).
size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i + 1;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

bool ParseInteger(const std::string& text, int* value) {
  return ParseInto(text, value);
}

bool ParseInteger(const std::string& text, uint64_t* value) {
  return ParseInto(text, value);
}

bool ParseReal(const std::string& text, double* value) {
  double parsed = 0;
  if (!ParseInto(text, &parsed) || !std::isfinite(parsed)) return false;
  *value = parsed;
  return true;
}

bool ParseBool(const std::string& text, bool* value) {
  const bool is_true = text == "1" || text == "true";
  if (!is_true && text != "0" && text != "false") return false;
  *value = is_true;
  return true;
}

bool IsSameWord(const std::string& a, const std::string& b) {
  return LowerCase(a) == LowerCase(b);
}

std::string NumberText(double value) { return RangeText("", value); }

std::string ChoiceText(const std::vector<std::string>& choices) {
  std::string text = "{";
  for (const std::string& choice : choices) {
    text += (text.size() == 1 ? "" : ", ") + choice;
  }
  return text + "}";
}

std::string NearestName(const std::string& name,
                        const std::vector<std::string>& candidates) {
  const std::string wanted = LowerCase(name);
  std::string nearest;
  size_t nearest_distance = wanted.size() / 3 + 1;
  for (const std::string& candidate : candidates) {
    const std::string whole = LowerCase(candidate);
    const std::string behind_group = whole.substr(whole.find('.') + 1);
    const size_t distance = std::min(EditDistance(wanted, behind_group),
                                     EditDistance(wanted, whole));
    if (distance < nearest_distance) {
      nearest_distance = distance;
      nearest = candidate;
    }
  }
  return nearest;
}

namespace {

// Breaks `text` at spaces into lines of at most 80 columns, each of them
// indented.
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
                             const AllowedRange<int>& range,
                             const std::string& description) {
  Add({name, description, "an integer " + range.text, std::to_string(*value),
       false, [value, contains = range.contains](const std::string& text) {
         return ParseInteger(text, value) && contains(*value);
       }});
}

void OptionTable::AddReal(const std::string& name, double* value,
                          const AllowedRange<double>& range,
                          const std::string& description) {
  Add({name, description, "a number " + range.text, NumberText(*value), false,
       [value, contains = range.contains](const std::string& text) {
         return ParseReal(text, value) && contains(*value);
       }});
}

void OptionTable::AddChoice(const std::string& name, std::string* value,
                            const std::vector<std::string>& choices,
                            const std::string& description) {
  std::vector<std::pair<std::string, std::string>> named;
  for (const std::string& choice : choices) named.emplace_back(choice, choice);
  AddNamed(name, value, named, description);
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

void OptionTable::RefuseAll(const std::vector<std::string>& names,
                            const std::string& why) const {
  for (const std::string& name : names) Refuse(name, why);
}

void OptionTable::Assign(const std::vector<OptionAssignment>& assignments) {
  std::set<std::string> names;
  for (const OptionAssignment& assignment : assignments) {
    const Option& option = Find(assignment);
    if (!names.insert(option.name).second && !option.repeatable) {
      throw OptionError(assignment.source + " is given twice");
    }
    // Earlier assignments win, as those of flags over files.
    if (IsGiven(option.name)) continue;
    if (!option.parse(assignment.text)) {
      throw OptionError(assignment.source + " = " +
                        (assignment.text.empty() ? "''" : assignment.text) +
                        ", must be " + option.range);
    }
  }
  for (const OptionAssignment& assignment : assignments) {
    // `emplace` keeps an earlier text.
    given_.emplace(assignment.name, assignment.text);
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
  if (wanted == "import_path") wanted = "input_path";  // COLMAP's old names
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
