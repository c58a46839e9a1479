#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <vector>

#include "krot/base/context.h"

namespace krot::internal {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kDegreesPerRadian = 180 / kPi;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The median, and of an even number of values the larger of the middle two.
// Requires at least one value.
inline double Median(std::vector<double> values) {
  const auto middle =
      values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The median, and of an even number of values the smaller of the middle two.
inline double LowerMedian(std::vector<double> values) {
  const auto middle =
      values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// 0, 1, ..., count - 1.
template <typename Number>
std::vector<Number> NumbersUpTo(int64_t count) {
  std::vector<Number> numbers(count);
  std::iota(numbers.begin(), numbers.end(), Number{0});
  return numbers;
}

// The indices in [0, count) for which `holds` is true, ascending.
template <typename Holds>
std::vector<int64_t> IndicesWhere(int64_t count, const Holds& holds) {
  std::vector<int64_t> indices;
  for (int64_t i = 0; i < count; ++i) {
    if (holds(i)) indices.push_back(i);
  }
  return indices;
}

// The number of elements, signed as indices are.
template <typename Container>
int64_t SignedSize(const Container& container) {
  return static_cast<int64_t>(container.size());
}

// Sorts by what `key` gives for a value, a member or a function: the largest
// first, and equal ones in the order in which they are.
template <typename Value, typename Key>
void SortLargestFirst(std::vector<Value>* values, const Key& key) {
  std::stable_sort(values->begin(), values->end(),
                   [&](const Value& a, const Value& b) {
                     return std::invoke(key, a) > std::invoke(key, b);
                   });
}

template <typename Value>
void SortUnique(std::vector<Value>* values) {
  std::sort(values->begin(), values->end());
  values->erase(std::unique(values->begin(), values->end()), values->end());
}

// Replace std::from_chars and std::to_chars for doubles, by functions of the C
// library, in standard libraries that have the two for integers alone.
std::optional<double> ParseRealByC(std::string_view text);
std::string ShortestTextByC(double value);

#ifdef __cpp_lib_to_chars
inline constexpr bool kCharconvHasReals = true;
#else
inline constexpr bool kCharconvHasReals = false;
#endif

// The number that the whole `text` stands for, read as by std::from_chars: no
// blank, no plus sign, independent of the locale. None if it is not a number,
// or if `Number` cannot hold it.
template <typename Number>
std::optional<Number> ParseNumber(std::string_view text) {
  if constexpr (std::is_floating_point_v<Number> && !kCharconvHasReals) {
    return ParseRealByC(text);
  } else {
    Number value;
    const char* const end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data(), end, value);
    if (error != std::errc() || stop != end) return std::nullopt;
    return value;
  }
}

// Appends the shortest text that ParseNumber reads as `value`, in the format of
// std::to_chars.
template <typename Number>
void AppendNumber(Number value, std::string* text) {
  if constexpr (std::is_floating_point_v<Number> && !kCharconvHasReals) {
    text->append(ShortestTextByC(value));
  } else {
    char digits[32];
    const auto result = std::to_chars(digits, digits + sizeof(digits), value);
    text->append(digits, result.ptr);
  }
}

// The lower median of each group's values. Values that are negative or not
// finite, or whose group is -1, do not count; a group without values gets NaN.
// If ranks share the values, it is the median of all ranks' values, to the bit.
// O(values + 256 groups), eight times.
std::vector<double> GroupMedians(const std::vector<double>& values,
                                 const std::vector<int32_t>& group_of,
                                 int32_t num_groups, const Context& context);

// The lower median of all values, likewise.
double MedianOf(const std::vector<double>& values, const Context& context);

// Union-find with path halving over 0, 1, ..., count - 1. At first each member
// is a set of its own. The root of a set is its smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(int64_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  int64_t Find(int64_t member) {
    while (parent_[member] != member) {
      parent_[member] = parent_[parent_[member]];
      member = parent_[member];
    }
    return member;
  }

  void Unite(int64_t a, int64_t b) {
    const auto [low, high] = std::minmax({Find(a), Find(b)});
    parent_[high] = low;
  }

 private:
  std::vector<int64_t> parent_;
};

}  // namespace krot::internal
