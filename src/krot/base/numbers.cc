#include "krot/base/numbers.h"

#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>

namespace krot::internal {
namespace {

std::string Print(const char* format, int decimals, double value) {
  std::string text(512, '\0');
  const int size =
      std::snprintf(text.data(), text.size(), format, decimals, value);
  text.resize(static_cast<size_t>(size));
  return text;
}

}  // namespace

// strtod accepts more than from_chars at the beginning of a text, accepts
// hexadecimal digits, and returns infinity or zero for numbers out of range.
std::optional<double> ParseRealByC(std::string_view text) {
  const std::string copy(text);
  const bool is_negative = !copy.empty() && copy[0] == '-';
  const char first = copy.c_str()[is_negative ? 1 : 0];
  if (!std::isalnum(static_cast<unsigned char>(first)) && first != '.') {
    return std::nullopt;
  }
  if (copy.find_first_of("xX") != std::string::npos) return std::nullopt;
  char* stop = nullptr;
  const double value = std::strtod(copy.c_str(), &stop);
  if (stop != copy.c_str() + copy.size()) return std::nullopt;
  if (std::isalpha(static_cast<unsigned char>(first))) return value;
  const bool is_zero =
      copy.find_first_of("123456789") >= copy.find_first_of("eE");
  if (std::isinf(value) || (value == 0 && !is_zero)) return std::nullopt;
  return value;
}

std::string ShortestTextByC(double value) {
  if (std::isnan(value)) return std::signbit(value) ? "-nan" : "nan";
  if (std::isinf(value)) return value < 0 ? "-inf" : "inf";
  constexpr int kMaxDecimals = std::numeric_limits<double>::max_digits10 - 1;
  int decimals = 0;
  std::string scientific = Print("%.*e", decimals, value);
  while (decimals < kMaxDecimals &&
         std::strtod(scientific.c_str(), nullptr) != value) {
    scientific = Print("%.*e", ++decimals, value);
  }
  const int exponent = std::atoi(scientific.c_str() + scientific.find('e') + 1);
  const std::string fixed =
      Print("%.*f", decimals > exponent ? decimals - exponent : 0, value);
  return fixed.size() <= scientific.size() ? fixed : scientific;
}

}  // namespace krot::internal
