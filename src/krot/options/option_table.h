#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "krot/options/option_error.h"
#include "krot/options/option_value.h"

namespace krot::internal {

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
