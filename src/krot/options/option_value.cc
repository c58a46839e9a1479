#include "krot/options/option_value.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numeric>
#include <sstream>

#include "krot/base/numbers.h"

namespace krot::internal {
namespace {

template <typename Number>
bool ParseInto(const std::string& text, Number* value) {
  const std::optional<Number> parsed = ParseNumber<Number>(text);
  if (parsed) *value = *parsed;
  return parsed.has_value();
}

std::string WithUnit(const std::string& text, const std::string& unit) {
  return unit.empty() ? text : text + ", " + unit;
}

std::string Text(int value) { return std::to_string(value); }
std::string Text(double value) { return NumberText(value); }

template <typename Number>
Range<Number> MakeAtLeast(Number min, const std::string& unit) {
  return {WithUnit(">= " + Text(min), unit),
          [min](Number value) { return value >= min; }};
}

template <typename Number>
Range<Number> MakeBetween(Number min, Number max, const std::string& unit) {
  return {WithUnit("in [" + Text(min) + ", " + Text(max) + "]", unit),
          [min, max](Number value) { return value >= min && value <= max; }};
}

std::string LowerCase(std::string text) {
  for (char& c : text) {
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return text;
}

// Insertions, deletions and replacements that turn a into b (Levenshtein).
size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i + 1;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

bool ParseInteger(const std::string& text, int* value) {
  return ParseInto(text, value);
}

bool ParseInteger(const std::string& text, uint64_t* value) {
  return ParseInto(text, value);
}

bool ParseReal(const std::string& text, double* value) {
  double parsed = 0;
  if (!ParseInto(text, &parsed) || !std::isfinite(parsed)) return false;
  *value = parsed;
  return true;
}

bool ParseBool(const std::string& text, bool* value) {
  const bool is_true = text == "1" || text == "true";
  if (!is_true && text != "0" && text != "false") return false;
  *value = is_true;
  return true;
}

bool IsSameWord(const std::string& a, const std::string& b) {
  return LowerCase(a) == LowerCase(b);
}

Range<int> AtLeast(int min, const std::string& unit) {
  return MakeAtLeast(min, unit);
}

Range<double> AtLeast(double min, const std::string& unit) {
  return MakeAtLeast(min, unit);
}

Range<double> Above(double min, const std::string& unit) {
  return {WithUnit("> " + NumberText(min), unit),
          [min](double value) { return value > min; }};
}

Range<int> Between(int min, int max, const std::string& unit) {
  return MakeBetween(min, max, unit);
}

Range<double> Between(double min, double max, const std::string& unit) {
  return MakeBetween(min, max, unit);
}

Range<double> InHalfOpen(double min, double max, const std::string& unit) {
  return {
      WithUnit("in [" + NumberText(min) + ", " + NumberText(max) + ")", unit),
      [min, max](double value) { return value >= min && value < max; }};
}

std::string NumberText(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string ChoiceText(const std::vector<std::string>& choices) {
  std::string text = "{";
  for (const std::string& choice : choices) {
    text += (text.size() == 1 ? "" : ", ") + choice;
  }
  return text + "}";
}

std::string NearestName(const std::string& name,
                        const std::vector<std::string>& candidates) {
  const std::string wanted = LowerCase(name);
  std::string nearest;
  size_t nearest_distance = wanted.size() / 3 + 1;
  for (const std::string& candidate : candidates) {
    const std::string whole = LowerCase(candidate);
    const std::string behind_group = whole.substr(whole.find('.') + 1);
    const size_t distance = std::min(EditDistance(wanted, behind_group),
                                     EditDistance(wanted, whole));
    if (distance < nearest_distance) {
      nearest_distance = distance;
      nearest = candidate;
    }
  }
  return nearest;
}

}  // namespace krot::internal
