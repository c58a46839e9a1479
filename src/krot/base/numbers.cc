#include "krot/base/numbers.h"

#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <limits>
#include <numeric>

namespace krot::internal {
namespace {

// As snprintf with one precision and one number.
std::string Print(const char* format, int decimals, double value) {
  std::string text(512, '\0');
  const int size =
      std::snprintf(text.data(), text.size(), format, decimals, value);
  text.resize(static_cast<size_t>(size));
  return text;
}

}  // namespace

// strtod differs from from_chars: it accepts more at the beginning of a text,
// accepts hexadecimal digits, and returns infinity or zero for numbers out of
// range. These cases are refused here.
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
  int decimals = 0;
  std::string scientific = Print("%.*e", decimals, value);
  while (decimals + 1 < std::numeric_limits<double>::max_digits10 &&
         std::strtod(scientific.c_str(), nullptr) != value) {
    scientific = Print("%.*e", ++decimals, value);
  }
  const int exponent = std::atoi(scientific.c_str() + scientific.find('e') + 1);
  const std::string fixed =
      Print("%.*f", decimals > exponent ? decimals - exponent : 0, value);
  return fixed.size() <= scientific.size() ? fixed : scientific;
}

namespace {

// The bits of doubles that are not negative, read as integers, have the order
// of their values. So the bits of the median are found from the highest on,
// eight at a time, by counting how many values have each continuation.
constexpr int kNumDigits = 1 << 8;

uint64_t BitsOf(double value) {
  uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof(bits));
  return bits;
}

double FromBits(uint64_t bits) {
  double value = 0;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

}  // namespace

std::vector<double> GroupMedians(const std::vector<double>& values,
                                 const std::vector<int32_t>& group_of,
                                 int32_t num_groups, const Context& context) {
  struct Candidate {
    uint64_t bits;
    int32_t group;
  };
  std::vector<Candidate> candidates;  // that have the bits found so far
  candidates.reserve(values.size());
  for (size_t n = 0; n < values.size(); ++n) {
    if (group_of[n] < 0 || !std::isfinite(values[n]) || values[n] < 0) continue;
    // This gives -0 the bits of 0.
    candidates.push_back({BitsOf(std::abs(values[n])), group_of[n]});
  }
  std::vector<uint64_t> found(num_groups, 0);  // the bits found so far
  // Values below the median among those with these bits.
  std::vector<int64_t> num_before(num_groups, -1);
  for (int shift = 64 - 8; shift >= 0; shift -= 8) {
    std::vector<int64_t> counts(static_cast<size_t>(num_groups) * kNumDigits);
    size_t num_left = 0;
    for (const Candidate candidate : candidates) {
      const uint64_t digits = candidate.bits >> shift;
      if (digits >> 8 != found[candidate.group]) continue;
      ++counts[candidate.group * kNumDigits + (digits & (kNumDigits - 1))];
      candidates[num_left++] = candidate;
    }
    candidates.resize(num_left);
    ReduceRanks(context, std::plus<int64_t>(), &counts);
    for (int32_t group = 0; group < num_groups; ++group) {
      const int64_t* count = &counts[group * kNumDigits];
      int64_t& before = num_before[group];
      if (shift == 64 - 8) {
        before =
            (std::accumulate(count, count + kNumDigits, int64_t{0}) - 1) / 2;
      }
      uint64_t digit = 0;
      while (digit + 1 < kNumDigits && before >= count[digit]) {
        before -= count[digit++];
      }
      found[group] = found[group] << 8 | digit;
    }
  }
  std::vector<double> medians;
  for (const uint64_t bits : found) medians.push_back(FromBits(bits));
  return medians;
}

double MedianOf(const std::vector<double>& values, const Context& context) {
  return GroupMedians(values, std::vector<int32_t>(values.size(), 0), 1,
                      context)[0];
}

}  // namespace krot::internal
