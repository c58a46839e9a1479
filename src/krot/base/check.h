#pragma once

#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace krot {

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

}  // namespace krot
