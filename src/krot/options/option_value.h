#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace krot::internal {

// From the text of a command line value to what it stands for. Each Parse
// function takes the whole text or returns false; the result is untouched
// then.

bool ParseInteger(const std::string& text, int* value);
bool ParseInteger(const std::string& text, uint64_t* value);
bool ParseReal(const std::string& text, double* value);  // finite
bool ParseBool(const std::string& text, bool* value);    // 0, 1, false, true

// Where a number may lie. `text` completes "must be ..."; help, messages and
// docs/cli.md all use it.
template <typename Number>
struct Range {
  std::string text;
  std::function<bool(Number)> contains;
};

// `unit` is appended to the text if not empty: ">= 0, pixels".
Range<int> AtLeast(int min, const std::string& unit = "");
Range<double> AtLeast(double min, const std::string& unit = "");
Range<double> Above(double min, const std::string& unit = "");
Range<int> Between(int min, int max, const std::string& unit = "");
Range<double> Between(double min, double max, const std::string& unit = "");
// [min, max)
Range<double> InHalfOpen(double min, double max, const std::string& unit = "");

// But for upper and lower case.
bool IsSameWord(const std::string& a, const std::string& b);

// As help and messages print numbers: "1e-06".
std::string NumberText(double value);

// "{a, b, c}"
std::string ChoiceText(const std::vector<std::string>& choices);

// The candidate that looks most like `name`, whole or behind its group, or ""
// if none looks like it at all: at most one edit per three characters, upper
// and lower case being alike.
std::string NearestName(const std::string& name,
                        const std::vector<std::string>& candidates);

}  // namespace krot::internal
