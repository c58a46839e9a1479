#pragma once

#include <string>

#include "krot/options/option_table.h"
#include "krot/tolerance/tolerance_analysis.h"

namespace krot::internal {

// What the options of `tolerance_analyzer` say before there is a model.
struct ToleranceArguments {
  ToleranceOptions options;  // without what the lists name
  // Separated by commas; "" if not given.
  std::string images;
  std::string points;
  std::string gauge_images;
};

// The options of `tolerance_analyzer`, without its paths.
void AddToleranceOptions(ToleranceArguments* arguments, Context* context,
                         OptionTable* table);

// With what the lists name of the model: images by name or, where none has such
// a name, by id; all images if neither images nor points are named. Throws
// OptionError for what the model does not have.
ToleranceOptions ResolveToleranceOptions(const ToleranceArguments& arguments,
                                         const Model& model);

}  // namespace krot::internal
