#include "krot/options/option_table.h"

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

TEST(OptionValue, IsTakenWholeOrNotAtAll) {
  int integer = 7;
  EXPECT_FALSE(ParseInteger("12x", &integer));
  EXPECT_FALSE(ParseInteger("", &integer));
  EXPECT_FALSE(ParseInteger("1e3", &integer));
  EXPECT_EQ(integer, 7);
  EXPECT_TRUE(ParseInteger("-12", &integer));
  EXPECT_EQ(integer, -12);

  double real = 7;
  EXPECT_FALSE(ParseReal("1,5", &real));
  EXPECT_FALSE(ParseReal("inf", &real));
  EXPECT_FALSE(ParseReal("nan", &real));
  EXPECT_FALSE(ParseReal("1e999", &real));
  EXPECT_EQ(real, 7);
  EXPECT_TRUE(ParseReal("1e-3", &real));
  EXPECT_EQ(real, 1e-3);
}

TEST(OptionValue, MayBeAnyUnsigned64BitSeed) {
  uint64_t seed = 0;
  EXPECT_TRUE(ParseInteger("18446744073709551615", &seed));
  EXPECT_EQ(seed, 18446744073709551615u);
  EXPECT_FALSE(ParseInteger("-1", &seed));
}

TEST(OptionValue, TakesColmapsTwoSpellingsOfBooleans) {
  bool value = false;
  EXPECT_TRUE(ParseBool("1", &value) && value);
  EXPECT_TRUE(ParseBool("false", &value) && !value);
  EXPECT_TRUE(ParseBool("true", &value) && value);
  EXPECT_TRUE(ParseBool("0", &value) && !value);
  EXPECT_FALSE(ParseBool("yes", &value));
}

TEST(OptionValue, RangesSayWhatTheyTest) {
  EXPECT_EQ(AtLeast(2).text, ">= 2");
  EXPECT_FALSE(AtLeast(2).contains(1));
  EXPECT_TRUE(AtLeast(2).contains(2));
  EXPECT_EQ(Above(0.0, "pixels").text, "> 0, pixels");
  EXPECT_FALSE(Above(0.0).contains(0));
  EXPECT_EQ(Between(0.5, 10.0).text, "in [0.5, 10]");
  EXPECT_TRUE(Between(0.5, 10.0).contains(10));
  EXPECT_EQ(InHalfOpen(0, 1).text, "in [0, 1)");
  EXPECT_FALSE(InHalfOpen(0, 1).contains(1));
}

TEST(NearestName, ForgivesSlipsCasesAndMissingGroups) {
  const std::vector<std::string> names = {"input_path", "output_path",
                                          "Solver.norm", "Solver.method"};
  EXPECT_EQ(NearestName("inputpath", names), "input_path");
  EXPECT_EQ(NearestName("solver.NORM", names), "Solver.norm");
  EXPECT_EQ(NearestName("method", names), "Solver.method");
  EXPECT_EQ(NearestName("image_list", names), "");
}

}  // namespace
}  // namespace krot::internal
