// Implemented with Boost.Program_options.

#include "tools/krot/given_options.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include <boost/program_options.hpp>

#include "krot/context.h"
#include "krot/model/formats.h"
#include "krot/options/option_table.h"

namespace krot::internal {
namespace {

namespace po = boost::program_options;

po::options_description Describe(const std::vector<Option>& options) {
  po::options_description description;
  for (const Option& option : options) {
    description.add_options()(option.name.c_str(), po::value<std::string>());
  }
  return description;
}

OptionAssignment ToAssignment(const po::option& option) {
  const std::string text = option.value.empty() ? "" : option.value.front();
  if (option.position_key >= 0) {
    throw OptionError("unexpected argument '" + text +
                      "'; options read --name value");
  }
  const bool is_separate = option.original_tokens.size() > 1;
  if (is_separate && text.rfind("--", 0) == 0) {
    throw OptionError("--" + option.string_key + " has no value");
  }
  return {option.string_key, text, "--" + option.string_key};
}

// The file as Boost can read it: without a byte order mark, and without
// comments after a semicolon that begins a line or follows a blank.
std::string IniText(const std::string& path, std::istream* stream) {
  const FileBytes file{path, {std::istreambuf_iterator<char>(*stream), {}}};
  std::istringstream lines{std::string(WithoutByteOrderMark(file))};
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    for (size_t i = 0; i < line.size(); ++i) {
      if (line[i] != ';') continue;
      if (i == 0 || line[i - 1] == ' ' || line[i - 1] == '\t') line.resize(i);
    }
    text += line + '\n';
  }
  return text;
}

}  // namespace

std::vector<OptionAssignment> GivenOptions(
    const std::vector<std::string>& arguments,
    const std::vector<Option>& options,
    const std::function<void(const OptionAssignment&)>& check) {
  const po::options_description description = Describe(options);
  std::vector<OptionAssignment> assignments;
  try {
    const po::parsed_options parsed =
        po::command_line_parser(arguments)
            .options(description)
            .style(po::command_line_style::allow_long |
                   po::command_line_style::long_allow_next |
                   po::command_line_style::long_allow_adjacent)
            .allow_unregistered()
            .run();
    for (const po::option& option : parsed.options) {
      assignments.push_back(ToAssignment(option));
      check(assignments.back());
    }
  } catch (const po::error& error) {
    throw OptionError(error.what());
  }
  return assignments;
}

std::vector<OptionAssignment> ReadProjectFile(
    const std::string& path, const std::vector<Option>& options) {
  const std::filesystem::path file(path);
  std::ifstream stream;
  std::error_code ignored;
  if (std::filesystem::is_regular_file(file, ignored)) stream.open(file);
  if (!stream.is_open()) {
    throw OptionError("--project_path = " + path +
                      ", must be a file that can be read");
  }
  const po::options_description description = Describe(options);
  std::vector<OptionAssignment> assignments;
  try {
    std::istringstream text(IniText(path, &stream));
    const po::parsed_options parsed =
        po::parse_config_file(text, description, true);
    for (const po::option& option : parsed.options) {
      assignments.push_back({option.string_key,
                             option.value.empty() ? "" : option.value.front(),
                             option.string_key + " in " + path});
    }
  } catch (const po::error& error) {
    throw OptionError(path + ": " + error.what());
  } catch (const ModelError& error) {
    throw OptionError(error.what());
  }
  return assignments;
}

}  // namespace krot::internal
