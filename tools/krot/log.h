#pragma once

#include <string>

namespace krot {

// Where a command's words go. Tables, its result, go to stdout; everything
// else goes to stderr.
struct LogOptions {
  int level = 1;           // 0: errors only, 1: progress, 2: details
  bool to_stderr = false;  // tables as well
};

// One line on stderr if `level` is asked for.
void LogLine(const LogOptions& options, int level, const std::string& line);

// A finished text for the user.
void PrintTable(const LogOptions& options, const std::string& text);

}  // namespace krot
