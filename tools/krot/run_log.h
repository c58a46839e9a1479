#pragma once

#include <filesystem>
#include <string>

#include "tools/krot/option_parser.h"

namespace krot::internal {

// The file of --log_path: all that is needed to repeat a run and to ask about
// it. Version, machine, every option's value and the digest of every file that
// was read; then each line of stderr, whatever the level, with the seconds; at
// last the exit code. It is written as it comes, so that a crash leaves it.

// Begins it, in place of what the file held. Throws WriteError.
void BeginRunLog(const std::string& file, const OptionParser& parser);

// The files of a folder that was read, or one file; nothing if there is no log.
void LogInput(const std::filesystem::path& path);

// Ends it; a run that has none ends without.
void EndRunLog(int exit_code);

}  // namespace krot::internal
