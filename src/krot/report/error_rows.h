#pragma once

#include <string>
#include <vector>

#include "krot/model.h"
#include "krot/report/text_table.h"

namespace krot::internal {

// One set of observations per row: how many, and their errors.
void AddErrorHead(const std::string& name, TextTable* table);
void AddErrorRow(const std::string& name, const PixelErrorStatistics& errors,
                 TextTable* table);

// The same observations, one estimate per column: rows for the maximum, P99,
// mean and RMS of each.
void AddErrorColumns(const std::vector<PixelErrorStatistics>& estimates,
                     TextTable* table);

// "3 observations without a finite error ..., in no row above.\n"; empty where
// there are none.
std::string NotFiniteSentence(const PixelErrorStatistics& errors);

}  // namespace krot::internal
