#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

namespace krot::internal {

// What tools/scripts/compare_linf_with_ba.sh found of one result.
struct Result {
  double max_error = 0;  // pixels, as all errors
  double rms_error = 0;
  double center_rms = 0;  // distances from the true centres, scene units
  double center_max = 0;
};

struct Comparison {
  int exit_code = -1;
  std::string table;  // what the script printed
  std::string words;  // what it said on stderr
  double scene_radius = 0;
  // Of the certificate, pixels; none if the solver could not have one.
  std::optional<double> lower_bound;
  std::map<std::string, Result> results;
};

// Runs the script on a model and the true cameras; results go to `output`.
Comparison CompareWithTruth(const std::filesystem::path& model,
                            const std::filesystem::path& truth,
                            const std::filesystem::path& output);

}  // namespace krot::internal
