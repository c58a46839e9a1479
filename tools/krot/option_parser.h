#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "krot/options/option_table.h"
#include "tools/krot/command_error.h"
#include "tools/krot/help_pages.h"
#include "tools/krot/log.h"

namespace krot::internal {

// Options in COLMAP's manner: --name value, --name=value, and --project_path
// FILE.ini, whose [Group] sections hold the same names. The command line wins
// over the file.
class OptionParser : public OptionTable {
 public:
  // Options of `program` `command`, which is what messages and help call it.
  OptionParser(const std::string& command, std::string summary,
               const std::string& program = "krot");

  void AddPath(const std::string& name, std::string* value, bool required,
               const std::string& range, const std::string& description);
  // A file that the command writes. Parse refuses a path that another option,
  // for output or input, names already.
  void AddOutputFile(const std::string& name, std::string* value,
                     const std::string& description);

  // Sets what happens once all values are set, before the work begins.
  void OnParsed(std::function<void()> action) {
    on_parsed_ = std::move(action);
  }

  // Sets the values. Returns false, with nothing set, if the arguments ask for
  // help. Throws OptionError for the first mistake.
  bool Parse(const std::vector<std::string>& arguments);

  // The help that Parse was asked for: a text, a manual page, or what a shell
  // needs to complete this command.
  std::string Help() const;

 private:
  struct PathOption {
    std::string name;
    const std::string* value;
    bool is_output_file = false;
  };

  void CheckOutputFiles() const;

  std::vector<PathOption> paths_;
  std::function<void()> on_parsed_;
  HelpFormat help_format_ = HelpFormat::kText;
};

// Sets the values, or prints the help that is asked for and returns false.
inline bool ParseOrPrintHelp(const std::vector<std::string>& arguments,
                             const LogOptions& log, OptionParser* parser) {
  if (parser->Parse(arguments)) return true;
  PrintTable(log, parser->Help());
  return false;
}

}  // namespace krot::internal
