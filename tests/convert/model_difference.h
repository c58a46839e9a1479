#pragma once

#include <string>

#include "krot/model.h"

namespace krot::internal {

// Names the first difference between two models; empty if there is none.
// Numbers are compared by their bits. With `ignore_geometry`, translations of
// frames and images and the coordinates of points are not compared.
std::string ModelDifference(const Model& a, const Model& b,
                            bool ignore_geometry);

}  // namespace krot::internal
