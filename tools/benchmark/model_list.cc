#include "tools/benchmark/model_list.h"

#include <exception>

namespace krot::internal {

std::vector<std::string> MeasureModels(
    const BenchmarkOptions& options,
    const std::function<void(const std::string& path)>& measure) {
  std::vector<std::string> left_out;
  std::exception_ptr last;
  for (const std::string& path : options.input_paths) {
    LogLine(options.log, 1, path);
    try {
      measure(path);
    } catch (const std::exception& error) {
      left_out.push_back("Left out: " + std::string(error.what()) + ".");
      LogLine(options.log, 0, left_out.back());
      last = std::current_exception();
    }
  }
  if (last && left_out.size() == options.input_paths.size()) {
    std::rethrow_exception(last);
  }
  return left_out;
}

}  // namespace krot::internal
