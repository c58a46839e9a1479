#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace krot::internal {

// An option that cannot be obeyed; what() is one sentence for the user.
class OptionError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// From the text of a command line value to what it stands for. Each Parse
// function takes the whole text or returns false; the result is untouched
// then.

bool ParseInteger(const std::string& text, int* value);
bool ParseInteger(const std::string& text, uint64_t* value);
bool ParseReal(const std::string& text, double* value);  // finite
bool ParseBool(const std::string& text, bool* value);    // 0, 1, false, true

// Where a number may lie. `text` completes "must be ..."; help, messages and
// docs/cli.md all use it.
template <typename Number>
struct Range {
  std::string text;
  std::function<bool(Number)> contains;
};

// `unit` is appended to the text if not empty: ">= 0, pixels".
Range<int> AtLeast(int min, const std::string& unit = "");
Range<double> AtLeast(double min, const std::string& unit = "");
Range<double> Above(double min, const std::string& unit = "");
Range<int> Between(int min, int max, const std::string& unit = "");
Range<double> Between(double min, double max, const std::string& unit = "");
// [min, max)
Range<double> InHalfOpen(double min, double max, const std::string& unit = "");

// But for upper and lower case.
bool IsSameWord(const std::string& a, const std::string& b);

// As help and messages print numbers: "1e-06".
std::string NumberText(double value);

// "{a, b, c}"
std::string ChoiceText(const std::vector<std::string>& choices);

// The candidate that looks most like `name`, whole or behind its group, or ""
// if none looks like it at all: at most one edit per three characters, upper
// and lower case being alike.
std::string NearestName(const std::string& name,
                        const std::vector<std::string>& candidates);

// One option. `range` completes "must be ..." and `parse` decides it.
struct Option {
  std::string name;          // "Solver.norm"
  std::string description;   // a phrase, without full stop
  std::string range;         // ">= 0, pixels"
  std::string default_text;  // "" if there is none
  bool required = false;
  std::function<bool(const std::string& text)> parse;
  bool repeatable = false;                // parse is called for every one
  std::vector<std::string> choices = {};  // all that it takes, if they are few
  // One of COLMAP's that changes nothing here: parse refuses what would. Help
  // has no more than its name.
  bool is_without_effect = false;
};

// What one argument, one line of a project file or one keyword says.
struct OptionAssignment {
  std::string name;
  std::string text;
  std::string source;  // "--name", or "name in file.ini"
};

// The options of one command under COLMAP's kind of names, each bound to where
// its value goes: for the command line, for Python, for whoever has names and
// texts.
class OptionTable {
 public:
  // `command`, "krot solver", as messages and help call it; "krot solver -h",
  // or wherever else its options are listed.
  OptionTable(std::string command, std::string summary, std::string list);

  void Add(Option option);
  void AddBool(const std::string& name, bool* value,
               const std::string& description);
  void AddInteger(const std::string& name, int* value, const Range<int>& range,
                  const std::string& description);
  void AddReal(const std::string& name, double* value,
               const Range<double>& range, const std::string& description);
  // In upper or lower case, as COLMAP has it.
  void AddChoice(const std::string& name, std::string* value,
                 const std::vector<std::string>& choices,
                 const std::string& description);
  // A choice of what the names stand for, in any case; the value's own is the
  // default.
  template <typename T>
  void AddNamed(const std::string& name, T* value,
                const std::vector<std::pair<std::string, T>>& choices,
                const std::string& description);
  // -1 stands for all; `remark` says what their number changes.
  void AddThreads(const std::string& name, int* value,
                  const std::string& remark);

  // Sets the values, but for those that earlier calls set. Throws OptionError
  // for the first thing wrong; an unknown name comes with the nearest known
  // one.
  void Assign(const std::vector<OptionAssignment>& assignments);

  // Throws OptionError for the first required option that is not set.
  void RequireAll() const;

  // Whether it was set.
  bool IsGiven(const std::string& name) const;

  // The value as it was given, the default if it was not.
  std::string Text(const std::string& name) const;

  // Throws OptionError if it is given: it "has no effect `why`".
  void Refuse(const std::string& name, const std::string& why) const;

  // Every option with its range and default; 80 columns.
  std::string Help() const;

  const std::string& command() const { return command_; }
  const std::string& summary() const { return summary_; }
  const std::vector<Option>& options() const { return options_; }

 protected:
  // Throws OptionError, naming the nearest option, if there is none.
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
