#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "krot/check.h"
#include "krot/model.h"
#include "krot/report/run_record.h"

namespace krot::internal {

// What one run of `krot model_checker` found.
struct CheckReport {
  RunRecord run;
  ModelCheck check;
  int64_t num_observations = 0;  // of the input
  PixelErrorStatistics pixel_error_before;
  PixelErrorStatistics pixel_error_after;  // of the cured model
  std::vector<std::string> moved;          // ModelCure
  double seconds_check = 0;                // wall clock
  // For the commands that come next; "": a name in capitals stands for it.
  std::string input_path;
  std::string output_path;
  std::string database_path;
};

// Why an image has its verdict; empty for one that is fine.
std::string ReasonOf(const ModelCheck& check, const ImageCheck& image);

// "2 of 41 images and 37 of 20,785 observations are wrong", or "Nothing is
// wrong", and why.
std::string CheckSentence(const CheckReport& report);

// For the terminal: the sentence, what matches say (PairTable), images by
// verdict, observations by w, tracks of two points, what to do next. At most
// max_rows of each.
std::string CheckTable(const CheckReport& report, int max_rows);

// report.json; the keys are listed in docs/cli.md. What is not known is null.
std::string CheckJson(const CheckReport& report);

}  // namespace krot::internal
