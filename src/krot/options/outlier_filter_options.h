#pragma once

#include "krot/options/option_table.h"
#include "krot/outliers/outlier_filter.h"

namespace krot {

// The options of `outlier_filter`, without its paths.
void AddOutlierFilterOptions(OutlierFilterOptions* options, Context* context,
                             OptionTable* table);

}  // namespace krot
