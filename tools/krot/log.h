#pragma once

#include <functional>
#include <optional>
#include <string>

namespace krot::internal {

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

// One line on stderr if `level` is asked for.
void LogLine(const LogOptions& options, int level, const std::string& line);

// Warns on stderr, whatever the level. Keeps a reference.
std::function<void(const std::string&)> WarnOn(const LogOptions& options);

// A finished text for the user.
void PrintTable(const LogOptions& options, const std::string& text);

// How far the work has come.
struct Progress {
  std::string stage;               // a new one begins a line of its own
  std::string words;               // what it has reached
  std::optional<double> fraction;  // of the stage: fills a bar; never falls
};

// Tells of it on stderr from level 1 on. On a terminal the stage's line
// rewrites itself and is cut to the terminal's width, which is asked for every
// time. Where there is none, or TERM is dumb or missing, lines are printed: a
// stage's first and last ones and, between them, one every two seconds, later
// every tenth of the time so far, at most every minute; from level 2 on all.
// Stages that come again leave no further lines behind. After two seconds
// without news the last words are said again, with the seconds since then,
// except in builds without threads. Thread-safe.
void ShowProgress(const LogOptions& options, const Progress& progress);

// Work that has no steps to tell of, as "reading FOLDER": its words appear once
// it has taken two seconds; from level 2 on at once, as a line. Thread-safe.
void BeginPhase(const LogOptions& options, const std::string& words);

// Ends the line of the stage, or the phase, and forgets which stages there
// were. LogLine and PrintTable leave the line, too, before they print.
void EndProgress();

// The words, with a bar in front if there is room for one, in less than
// `columns` columns.
std::string FitProgress(const Progress& progress, int columns);

}  // namespace krot::internal
