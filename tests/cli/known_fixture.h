#pragma once

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/cli/krot_process.h"

namespace krot::internal {

// Solves with files of what else is known beside the model.
class Known : public ::testing::Test {
 protected:
  KrotResult Solve(const std::string& input, const std::string& output,
                   const Words& more = {}) const {
    return RunKrot(
        {"solver", "--input_path", folder_ / input, "--output_path",
         folder_ / output, "--report_path", folder_ / (output + ".json"),
         "--certificate_path", folder_ / (output + "_proof.json")},
        more);
  }
  Json Report(const std::string& output) const {
    return ReadJson(folder_ / (output + ".json"));
  }
  KrotResult Check(const std::string& model, const std::string& output) const {
    return RunKrot({"certificate_checker", "--input_path", folder_ / model,
                    "--certificate_path", folder_ / (output + "_proof.json")});
  }

  TempFolder folder_;
};

}  // namespace krot::internal
