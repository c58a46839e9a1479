#pragma once

#include <cstdint>
#include <functional>
#include <set>
#include <string>
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

  // Sets the values. Returns false, with nothing set, if the arguments ask
  // for help. Throws OptionError for the first thing wrong; an unknown name
  // comes with the nearest known one.
  bool Parse(const std::vector<std::string>& arguments);

  // Whether the arguments or the project file set this option.
  bool IsGiven(const std::string& name) const;

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

}  // namespace krot
