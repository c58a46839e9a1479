#include "tools/krot/log.h"

#include <iostream>
#include <utility>

namespace krot {
namespace {

LogSink log_sink;

}  // namespace

void SetLogSink(LogSink sink) { log_sink = std::move(sink); }

void LogToSink(const std::string& text) {
  if (log_sink) log_sink(text);
}

void LogLine(const LogOptions& options, int level, const std::string& line) {
  LogToSink(line);
  // In one piece: a signal's sentence begins a line of its own.
  if (options.level >= level) std::cerr << line + '\n' << std::flush;
}

std::function<void(const std::string&)> WarnOn(const LogOptions& options) {
  return [&options](const std::string& text) {
    LogLine(options, 0, "warning: " + text);
  };
}

void PrintTable(const LogOptions& options, const std::string& text) {
  LogToSink(text);
  (options.to_stderr ? std::cerr : std::cout) << text << std::flush;
}

}  // namespace krot
