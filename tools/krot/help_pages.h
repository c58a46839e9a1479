#pragma once

#include <optional>
#include <string>
#include <vector>

#include "krot/options/option_table.h"

namespace krot::internal {

// What --help may print: --help or -h, --help=man, --help=bash, --help=zsh.
enum class HelpFormat { kText, kMan, kBash, kZsh };

// The kind of help that the arguments ask for, if any. Throws OptionError for a
// format that does not exist.
std::optional<HelpFormat> AskedHelp(const std::vector<std::string>& arguments);

// A line of `krot help`.
struct CommandSummary {
  std::string name;
  std::string summary;
};

// The manual page of one command, in section 1: "krot solver" is
// krot-solver(1).
std::string ManPage(const OptionTable& table);

// The manual page of krot itself: its commands, and its exit codes, which are
// given as lines "  code text".
std::string ManPage(const std::vector<CommandSummary>& commands,
                    const std::string& exit_codes);

// A branch `NAME) ... ;;` that completes the command's options and their
// values. BashHead or ZshHead, all commands' branches and BashTail or ZshTail
// are a whole script.
std::string BashCompletion(const OptionTable& table);
std::string BashHead(const std::vector<CommandSummary>& commands);
std::string BashTail();
std::string ZshCompletion(const OptionTable& table);
std::string ZshHead(const std::vector<CommandSummary>& commands);
std::string ZshTail();

}  // namespace krot::internal
