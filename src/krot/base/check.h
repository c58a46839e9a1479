#pragma once

#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace krot::internal {

// Argument errors read "name = value, must be requirement".
//
//   CheckArgument(step > 0, "options.step_tolerance", step, "> 0");
//
// Throws std::invalid_argument when `ok` is false.
template <typename Value>
void CheckArgument(bool ok, std::string_view name, const Value& value,
                   std::string_view requirement) {
  if (ok) return;
  std::ostringstream message;
  message << name << " = " << value << ", must be " << requirement;
  throw std::invalid_argument(message.str());
}

template <typename Value>
void CheckPositive(const Value& value, std::string_view name) {
  CheckArgument(value > 0, name, value, "> 0");
}

template <typename Value>
void CheckAtLeast(int least, const Value& value, std::string_view name) {
  if (value >= least) return;  // saves making the text
  CheckArgument(false, name, value, ">= " + std::to_string(least));
}

}  // namespace krot::internal
