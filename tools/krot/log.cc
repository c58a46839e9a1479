#include "tools/krot/log.h"

#include <iostream>

namespace krot {

void LogLine(const LogOptions& options, int level, const std::string& line) {
  if (options.level >= level) std::cerr << line << std::endl;
}

void PrintTable(const LogOptions& options, const std::string& text) {
  (options.to_stderr ? std::cerr : std::cout) << text << std::flush;
}

}  // namespace krot
