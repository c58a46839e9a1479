#pragma once

#include <stdexcept>
#include <string>

namespace krot {

// A model that cannot be read or used. what() is one sentence:
// the file, the place in it (byte offset or line), what was found and what
// was expected.
class ModelError : public std::runtime_error {
 public:
  explicit ModelError(const std::string& message)
      : std::runtime_error(message) {}
};

}  // namespace krot
