#pragma once

#include <string>
#include <vector>

#include "krot/model.h"

namespace krot::internal {

// The image names that COLMAP's text reader would cut at their first white
// space, in the order of the images. KROT reads them whole; warn before
// writing them as text.
std::vector<std::string> ImageNamesWithWhiteSpace(const Model& model);

}  // namespace krot::internal
