#pragma once

#include <stdexcept>

namespace krot::internal {

// An option that cannot be obeyed; what() is one sentence for the user.
class OptionError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace krot::internal
