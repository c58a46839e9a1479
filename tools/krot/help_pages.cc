#include "tools/krot/help_pages.h"

#include <sstream>

#include "krot/version.h"

namespace krot::internal {
namespace {

constexpr char kHelp[] = "--help=";

// "solver" of "krot solver".
std::string LastWord(const std::string& command) {
  return command.substr(command.rfind(' ') + 1);
}

std::string Replaced(const std::string& text, const std::string& characters,
                     const std::string& before) {
  std::string replaced;
  for (const char c : text) {
    if (characters.find(c) != std::string::npos) replaced += before;
    replaced += c;
  }
  return replaced;
}

// Escapes text for roff: a typed hyphen is a minus, and no line starts a
// request.
std::string Roff(const std::string& text) {
  std::string roff = Replaced(Replaced(text, "\\", "\\"), "-", "\\");
  if (!roff.empty() && (roff[0] == '.' || roff[0] == '\'')) {
    roff = "\\&" + roff;
  }
  return roff;
}

std::string RoffHead(const std::string& title, const std::string& summary) {
  return ".TH " + Replaced(title, "-", "\\") +
         " 1 \"\" \"krot " KROT_VERSION "\" \"User Commands\"\n.SH NAME\n" +
         Roff(title) + " \\- " + Roff(summary) + "\n.SH SYNOPSIS\n.B ";
}

// Escapes text that stands within '...' of a shell.
std::string Quoted(const std::string& text) {
  std::string quoted;
  for (const char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted;
}

std::string Joined(const std::vector<std::string>& words) {
  std::string joined;
  for (const std::string& word : words) {
    joined += (joined.empty() ? "" : " ") + word;
  }
  return joined;
}

}  // namespace

std::optional<HelpFormat> AskedHelp(const std::vector<std::string>& arguments) {
  for (const std::string& argument : arguments) {
    if (argument == "-h" || argument == "--help") return HelpFormat::kText;
    if (argument.rfind(kHelp, 0) != 0) continue;
    const std::string format = argument.substr(sizeof(kHelp) - 1);
    if (format == "text") return HelpFormat::kText;
    if (format == "man") return HelpFormat::kMan;
    if (format == "bash") return HelpFormat::kBash;
    if (format == "zsh") return HelpFormat::kZsh;
    throw OptionError("--help = " + format + ", must be one of " +
                      ChoiceText({"text", "man", "bash", "zsh"}));
  }
  return std::nullopt;
}

std::string ManPage(const OptionTable& table) {
  const std::string name = LastWord(table.command());
  std::string page =
      RoffHead("krot-" + name, table.summary()) + "krot " + Roff(name) + "\n";
  for (const Option& option : table.options()) {
    if (!option.required) continue;
    page += ".BI \\-\\-" + Roff(option.name) + " \" VALUE\"\n";
  }
  page += "[options]\n.SH OPTIONS\n";
  for (const Option& option : table.options()) {
    if (option.is_without_effect) continue;
    page += ".TP\n.BI \\-\\-" + Roff(option.name) + " \" VALUE\"\n" +
            Roff(option.description) + ".\n.br\nValue: " + Roff(option.range) +
            ".";
    if (option.required) page += " Required.";
    if (!option.default_text.empty()) {
      page += " Default: " + Roff(option.default_text) + ".";
    }
    page += '\n';
  }
  return page + ".SH SEE ALSO\n.BR krot (1)\n";
}

std::string ManPage(const std::vector<CommandSummary>& commands,
                    const std::string& exit_codes) {
  std::string page =
      RoffHead("krot", "the known rotation problem for COLMAP models") +
      "krot\n.I COMMAND\n[options]\n.SH COMMANDS\n";
  std::string see_also;
  for (const CommandSummary& command : commands) {
    page +=
        ".TP\n.B " + Roff(command.name) + "\n" + Roff(command.summary) + "\n";
    if (command.name == "help") continue;
    see_also += (see_also.empty() ? ".BR krot\\-" : " (1),\n.BR krot\\-") +
                Roff(command.name);
  }
  page += ".SH EXIT STATUS\n";
  std::istringstream lines(exit_codes);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string code, text;
    words >> code >> std::ws;
    std::getline(words, text);
    page += ".TP\n.B " + code + "\n" + Roff(text) + "\n";
  }
  return page + ".SH SEE ALSO\n" + see_also + " (1)\n";
}

std::string BashCompletion(const OptionTable& table) {
  std::string names, values;
  for (const Option& option : table.options()) {
    if (option.is_without_effect) continue;
    names += " --" + option.name;
    if (option.choices.empty()) continue;
    values += "        --" + option.name + ") words='" +
              Joined(option.choices) + "' ;;\n";
  }
  return "    " + LastWord(table.command()) + ")\n      options='" +
         names.substr(1) + "'\n      case $previous in\n" + values +
         "      esac ;;\n";
}

std::string BashHead(const std::vector<CommandSummary>& commands) {
  std::vector<std::string> names;
  for (const CommandSummary& command : commands) names.push_back(command.name);
  return "# bash completion for krot " KROT_VERSION
         "\n_krot() {\n"
         "  local current=${COMP_WORDS[COMP_CWORD]} options='' words=''\n"
         "  local previous=${COMP_WORDS[COMP_CWORD-1]} commands='" +
         Joined(names) +
         "'\n"
         "  case ${COMP_WORDS[1]} in\n"
         "    help) options=$commands ;;\n";
}

std::string BashTail() {
  return "  esac\n"
         "  if ((COMP_CWORD == 1)); then\n"
         "    words=\"$commands --version\"\n"
         "  elif [[ -z $words && ( $current == -* || $previous != --* ) ]]; "
         "then\n"
         "    words=$options\n"
         "  fi\n"
         "  COMPREPLY=($(compgen -W \"$words\" -- \"$current\"))\n"
         "}\n"
         "complete -o default -F _krot krot\n";
}

std::string ZshCompletion(const OptionTable& table) {
  std::string specs;
  for (const Option& option : table.options()) {
    if (option.is_without_effect) continue;
    const std::string first =
        option.description.substr(0, option.description.find_first_of(":;"));
    specs += " \\\n        '--" + option.name + "[" +
             Quoted(Replaced(first, "[]\\", "\\")) +
             "]:" + Quoted(Replaced(option.range, ":\\", "\\")) + ":" +
             (option.choices.empty() ? "_files"
                                     : "(" + Joined(option.choices) + ")") +
             "'";
  }
  return "    " + LastWord(table.command()) + ")\n      _arguments" + specs +
         " ;;\n";
}

std::string ZshHead(const std::vector<CommandSummary>& commands) {
  std::string described;
  for (const CommandSummary& command : commands) {
    described += "    '" + command.name + ":" + Quoted(command.summary) + "'\n";
  }
  return "#compdef krot\n"
         "_krot() {\n"
         "  local -a commands=(\n" +
         described +
         "  )\n"
         "  if ((CURRENT == 2)); then\n"
         "    _describe command commands\n"
         "    return\n"
         "  fi\n"
         "  shift words\n"
         "  ((CURRENT--))\n"
         "  case $words[1] in\n"
         "    help) _describe command commands ;;\n";
}

std::string ZshTail() {
  return "  esac\n"
         "}\n"
         "_krot \"$@\"\n";
}

}  // namespace krot::internal
