#pragma once

#include <string>

#include "krot/analysis/model_parts.h"
#include "krot/check.h"
#include "krot/report/report_json.h"

namespace krot::internal {

// For example "0.0123"; "anywhere" if nothing holds the image.
std::string SigmaText(double sigma);

// What too few tracks tie to the rest of a model; "" if all is tied.
std::string PartsSentence(const ModelCheck& check);
std::string PartTable(const ModelCheck& check, size_t max_rows);
nlohmann::ordered_json PartsJson(const ModelCheck& check);

// What the model still has that no adjustment mends, and what helps: a line for
// each; "" if there is nothing.
std::string LastingFaultLines(const LastingFaults& faults);

}  // namespace krot::internal
