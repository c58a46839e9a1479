#pragma once

#include <functional>
#include <string>

namespace krot {

// Where a command's words go. Tables, its result, go to stdout; everything
// else goes to stderr.
struct LogOptions {
  int level = 1;           // 0: errors only, 1: progress, 2: details
  bool to_stderr = false;  // tables as well
  std::string path;        // of the run's own log; "": none
};

// Takes every line and table, whatever the level; may be empty.
using LogSink = std::function<void(const std::string& text)>;
void SetLogSink(LogSink sink);

// To the sink alone: for what stderr shows in another way.
void LogToSink(const std::string& text);

// One line on stderr if `level` is asked for.
void LogLine(const LogOptions& options, int level, const std::string& line);

// Warns on stderr, whatever the level. Keeps a reference.
std::function<void(const std::string&)> WarnOn(const LogOptions& options);

// A finished text for the user.
void PrintTable(const LogOptions& options, const std::string& text);

}  // namespace krot
