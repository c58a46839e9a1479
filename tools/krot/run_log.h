#pragma once

#include <filesystem>
#include <string>

#include "tools/krot/option_parser.h"

namespace krot::internal {

// The file of --log_path: all that is needed to repeat a run and to ask about
// it. It has the version, the machine, every option's value and the digest of
// every file that was read; then each line of stderr, whatever the level, with
// the seconds; at last the exit code. It is written line by line, so that it is
// there after a crash.

// Begins the log and replaces what the file held. Throws WriteError.
void BeginRunLog(const std::string& file, const OptionParser& parser);

// Logs the files of a folder that was read, or one file. Does nothing without a
// log.
void LogInput(const std::filesystem::path& path);

// Ends the log, if there is one.
void EndRunLog(int exit_code);

}  // namespace krot::internal
