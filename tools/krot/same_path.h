#pragma once

#include <string>

namespace krot::internal {

// Whether both name the same file or folder, however they are written:
// relative, through links, with a slash at the end. They need not exist. ""
// names nothing.
bool IsSamePath(const std::string& a, const std::string& b);

}  // namespace krot::internal
