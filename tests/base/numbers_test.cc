#include "krot/base/numbers.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

// Of any bits: most are very large or very small.
double AnyNumber(std::mt19937_64* random) {
  const uint64_t bits = (*random)();
  double value;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

double OrdinaryNumber(std::mt19937_64* random) {
  const double digits =
      std::round(std::ldexp(static_cast<double>((*random)()), -40));
  const int exponent = static_cast<int>((*random)() % 30) - 15;
  return digits * std::pow(10.0, exponent);
}

std::string Standard(double value) {
  std::string text;
  AppendNumber(value, &text);
  return text;
}

TEST(NumberText, WritesWhatTheStandardLibraryWrites) {
  std::mt19937_64 random(1);
  for (int n = 0; n < 20000; ++n) {
    for (const double value : {AnyNumber(&random), OrdinaryNumber(&random)}) {
      if (std::isnan(value)) continue;
      ASSERT_EQ(ShortestTextByC(value), Standard(value));
    }
  }
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double value :
       {0.0, -0.0, 1.0, 1e22, 1e-5, 123456789012345678.0, 5e-324,
        1.7976931348623157e308, infinity, -infinity}) {
    EXPECT_EQ(ShortestTextByC(value), Standard(value));
  }
}

TEST(NumberText, ReadsWhatTheStandardLibraryReads) {
  std::mt19937_64 random(2);
  for (int n = 0; n < 20000; ++n) {
    const std::string text = Standard(AnyNumber(&random));
    ASSERT_EQ(ParseRealByC(text).has_value(),
              ParseNumber<double>(text).has_value());
    if (text.find("nan") != std::string::npos) continue;
    ASSERT_EQ(ParseRealByC(text), ParseNumber<double>(text));
  }
}

TEST(NumberText, RefusesWhatTheStandardLibraryRefuses) {
  for (const char* text :
       {"",      "-",          "+1",       " 1",    "1 ",     "0x10",   "1e",
        "e5",    ".",          "-.",       "1e400", "-1e400", "1e-400", "0e5",
        "0e400", "0.000e-999", "00",       "1.",    ".5",     "-.5",    "--1",
        "inf",   "-inf",       "infinity", "INF",   "1,5",    "1e5x",   "1f"}) {
    EXPECT_EQ(ParseRealByC(text), ParseNumber<double>(text)) << text;
  }
}

}  // namespace
}  // namespace krot::internal
