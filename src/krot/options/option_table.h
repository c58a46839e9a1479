#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace krot::internal {

// An option that cannot be accepted; what() is one sentence for the user.
class OptionError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Convert the text of a command line value. Each Parse function reads the whole
// text, or returns false and leaves the result unchanged.

bool ParseInteger(const std::string& text, int* value);
bool ParseInteger(const std::string& text, uint64_t* value);
bool ParseReal(const std::string& text, double* value);  // finite
bool ParseBool(const std::string& text, bool* value);    // 0, 1, false, true

// The range of a number. `text` completes "must be ..."; help, messages and
// docs/cli.md all use it.
template <typename Number>
struct AllowedRange {
  std::string text;
  std::function<bool(Number)> contains;
};

// The parts of a range's text, with the unit behind them if there is one:
// ">= 0, pixels".
template <typename... Parts>
std::string RangeText(const std::string& unit, const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  return unit.empty() ? text.str() : text.str() + ", " + unit;
}

template <typename Number>
AllowedRange<Number> AtLeast(Number min, const std::string& unit = "") {
  return {RangeText(unit, ">= ", min),
          [min](Number value) { return value >= min; }};
}
template <typename Number>
AllowedRange<Number> Above(Number min, const std::string& unit = "") {
  return {RangeText(unit, "> ", min),
          [min](Number value) { return value > min; }};
}
template <typename Number>
AllowedRange<Number> Between(Number min, Number max,
                             const std::string& unit = "") {
  return {RangeText(unit, "in [", min, ", ", max, "]"),
          [min, max](Number value) { return value >= min && value <= max; }};
}
// [min, max)
template <typename Number>
AllowedRange<Number> InHalfOpen(Number min, Number max,
                                const std::string& unit = "") {
  return {RangeText(unit, "in [", min, ", ", max, ")"),
          [min, max](Number value) { return value >= min && value < max; }};
}

// Whether the words are the same up to upper and lower case.
bool IsSameWord(const std::string& a, const std::string& b);

// A number as help and messages print it: "1e-06".
std::string NumberText(double value);

// The choices as help and messages print them: "{a, b, c}".
std::string ChoiceText(const std::vector<std::string>& choices);

// The candidate that is most similar to `name`, compared as a whole and without
// its group. "" if none is similar: at most one edit per three characters is
// allowed, and upper and lower case count as equal.
std::string NearestName(const std::string& name,
                        const std::vector<std::string>& candidates);

// One option. `range` completes "must be ..."; `parse` decides whether a text
// is in it, and sets the value.
struct Option {
  std::string name;          // "Solver.norm"
  std::string description;   // a phrase, without full stop
  std::string range;         // ">= 0, pixels"
  std::string default_text;  // "" if there is none
  bool required = false;
  std::function<bool(const std::string& text)> parse;
  // May be given several times; parse is called for each.
  bool repeatable = false;
  std::vector<std::string> choices = {};  // all values, if they are few
  // One of COLMAP's options that changes nothing in KROT: `parse` refuses
  // values that ask for what KROT cannot do. Help lists its name only.
  bool is_without_effect = false;
};

// An option's value, as one argument, one line of a project file or one keyword
// gives it.
struct OptionAssignment {
  std::string name;
  std::string text;
  std::string source;  // "--name", or "name in file.ini"
};

// The options of one command. They have COLMAP's kind of names, and each is
// bound to the variable that it sets. The command line, Python and anybody else
// who has names and texts can use them.
class OptionTable {
 public:
  // `command` is its name in messages and help, for example "krot solver";
  // `list` says where its options are listed, for example "krot solver -h".
  OptionTable(std::string command, std::string summary, std::string list);

  void Add(Option option);
  void AddBool(const std::string& name, bool* value,
               const std::string& description);
  void AddInteger(const std::string& name, int* value,
                  const AllowedRange<int>& range,
                  const std::string& description);
  void AddReal(const std::string& name, double* value,
               const AllowedRange<double>& range,
               const std::string& description);
  // The value may be given in upper or lower case, as in COLMAP; it is set to
  // one of `choices`.
  void AddChoice(const std::string& name, std::string* value,
                 const std::vector<std::string>& choices,
                 const std::string& description);
  // A choice among values that have names, in upper or lower case; the present
  // value is the default.
  template <typename T>
  void AddNamed(const std::string& name, T* value,
                const std::vector<std::pair<std::string, T>>& choices,
                const std::string& description);
  // -1 stands for all threads; `remark` says what their number changes.
  void AddThreads(const std::string& name, int* value,
                  const std::string& remark);

  // Sets the values, except those that earlier calls have set. Throws
  // OptionError for the first mistake; for an unknown name it suggests the
  // nearest known one.
  void Assign(const std::vector<OptionAssignment>& assignments);

  // Throws OptionError for the first required option that is not set.
  void RequireAll() const;

  // Whether the option was set.
  bool IsGiven(const std::string& name) const;

  // The value's text as it was given, or else the default's.
  std::string Text(const std::string& name) const;

  // Throws OptionError if the option was given: it "has no effect `why`".
  void Refuse(const std::string& name, const std::string& why) const;
  void RefuseAll(const std::vector<std::string>& names,
                 const std::string& why) const;

  // Every option with its range and default; 80 columns.
  std::string Help() const;

  const std::string& command() const { return command_; }
  const std::string& summary() const { return summary_; }
  const std::vector<Option>& options() const { return options_; }

 protected:
  // Throws OptionError, which suggests the nearest option, if there is none.
  const Option& Find(const OptionAssignment& assignment) const;

 private:
  std::string command_;
  std::string summary_;
  std::string list_;
  std::vector<Option> options_;
  std::map<std::string, std::string> given_;  // name -> text
};

template <typename T>
void OptionTable::AddNamed(
    const std::string& name, T* value,
    const std::vector<std::pair<std::string, T>>& choices,
    const std::string& description) {
  std::vector<std::string> names;
  std::string default_text;
  for (const auto& [text, meaning] : choices) {
    names.push_back(text);
    if (meaning == *value) default_text = text;
  }
  Add({name, description, "one of " + ChoiceText(names), default_text, false,
       [value, choices](const std::string& given) {
         for (const auto& [text, meaning] : choices) {
           if (!IsSameWord(text, given)) continue;
           *value = meaning;
           return true;
         }
         return false;
       },
       false, names});
}

}  // namespace krot::internal
