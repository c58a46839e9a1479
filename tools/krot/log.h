#pragma once

#include <functional>
#include <optional>
#include <string>

namespace krot::internal {

// Where a command's output goes. Tables, which are its result, go to stdout;
// everything else goes to stderr.
struct LogOptions {
  int level = 1;           // 0: errors only, 1: progress, 2: details
  bool to_stderr = false;  // tables as well
  std::string path;        // of the log of the run (run_log.h); "": none
};

// Receives every line and table, whatever the level; may be empty.
using LogSink = std::function<void(const std::string& text)>;
void SetLogSink(LogSink sink);

// Prints a line on stderr if the level is at least `level`.
void LogLine(const LogOptions& options, int level, const std::string& line);

// A function that prints warnings on stderr at any level. Keeps a reference.
std::function<void(const std::string&)> WarnOn(const LogOptions& options);

// Prints a table for the user.
void PrintTable(const LogOptions& options, const std::string& text);

// How far the work has come.
struct Progress {
  std::string stage;               // a new one begins a line of its own
  std::string words;               // what it has reached
  std::optional<double> fraction;  // of the stage, for a bar; never falls
};

// Shows it on stderr from level 1 on. On a terminal the stage's line rewrites
// itself and is cut to the terminal's width, which is asked for every time.
// Without a terminal, or where TERM is dumb or missing, lines are printed: a
// stage's first and last ones and, between them, one every two seconds, later
// one every tenth of the time so far, at least one a minute; from level 2 on
// all of them. A stage that comes again leaves no further line behind. After
// two seconds without news the last words are shown again, with the seconds
// since then, except in builds without threads. Thread-safe.
void ShowProgress(const LogOptions& options, const Progress& progress);

// Begins work that has no steps to show, as "reading FOLDER". Its words appear
// after two seconds, or, from level 2 on, at once as a line. Thread-safe.
void BeginPhase(const LogOptions& options, const std::string& words);

// Ends the line of the stage or the phase, and forgets which stages there were.
// LogLine and PrintTable end the line, too, before they print.
void EndProgress();

// The words, with a bar in front if there is room for one, in fewer than
// `columns` columns.
std::string FitProgress(const Progress& progress, int columns);

}  // namespace krot::internal
