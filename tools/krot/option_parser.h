#pragma once

#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tools/krot/command_error.h"
#include "tools/krot/option_value.h"

namespace krot {

// One flag. `range` completes "must be ..." and `parse` decides it.
struct Option {
  std::string name;          // "Solver.norm"
  std::string description;   // a phrase, without full stop
  std::string range;         // ">= 0, pixels"
  std::string default_text;  // "" if there is none
  bool required = false;
  std::function<bool(const std::string& text)> parse;
  bool repeatable = false;  // parse is called for every one
};

// What one argument, or one line of a project file, says.
struct OptionAssignment {
  std::string name;
  std::string text;
  std::string source;  // "--name", or "name in file.ini"
};

// COLMAP's manner of options: --name value, --name=value, and
// --project_path FILE.ini, whose [Group] sections hold the same names;
// explicit flags win over the file.
class OptionParser {
 public:
  // Of `program` `command`, as messages and help call it.
  OptionParser(const std::string& command, std::string summary,
               const std::string& program = "krot");

  void Add(Option option);
  void AddPath(const std::string& name, std::string* value, bool required,
               const std::string& range, const std::string& description);
  // A file that the command writes: Parse refuses one that another path, of an
  // output or an input, names already.
  void AddOutputFile(const std::string& name, std::string* value,
                     const std::string& description);
  void AddBool(const std::string& name, bool* value,
               const std::string& description);
  void AddInteger(const std::string& name, int* value, const Range<int>& range,
                  const std::string& description);
  void AddReal(const std::string& name, double* value,
               const Range<double>& range, const std::string& description);
  void AddChoice(const std::string& name, std::string* value,
                 const std::vector<std::string>& choices,
                 const std::string& description);
  // A choice of what the names stand for; the value's own is the default.
  template <typename T>
  void AddNamed(const std::string& name, T* value,
                const std::vector<std::pair<std::string, T>>& choices,
                const std::string& description);
  // -1 stands for all; `remark` says what their number changes.
  void AddThreads(const std::string& name, int* value,
                  const std::string& remark);

  // Sets the values. Returns false, with nothing set, if the arguments ask
  // for help. Throws OptionError for the first thing wrong; an unknown name
  // comes with the nearest known one.
  bool Parse(const std::vector<std::string>& arguments);

  // Whether the arguments or the project file set this option.
  bool IsGiven(const std::string& name) const;

  // Throws OptionError if it is given: it "has no effect `why`".
  void Refuse(const std::string& name, const std::string& why) const;

  // Every option with its range and default; 80 columns.
  std::string Help() const;

 private:
  struct PathOption {
    std::string name;
    const std::string* value;
    bool is_output_file = false;
  };

  std::vector<OptionAssignment> ReadArguments(
      const std::vector<std::string>& arguments) const;
  std::vector<OptionAssignment> ReadProjectFile(const std::string& path) const;
  void Assign(const std::vector<OptionAssignment>& assignments);
  void CheckOutputFiles() const;
  // Throws OptionError, naming the nearest option, if there is none.
  const Option& Find(const OptionAssignment& assignment) const;

  std::string command_;
  std::string summary_;
  std::vector<Option> options_;
  std::vector<PathOption> paths_;
  std::set<std::string> given_;
};

template <typename T>
void OptionParser::AddNamed(
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
           if (text != given) continue;
           *value = meaning;
           return true;
         }
         return false;
       }});
}

}  // namespace krot
