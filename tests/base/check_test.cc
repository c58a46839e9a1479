#include "krot/base/check.h"

#include <gtest/gtest.h>

#include "krot/base/context.h"

namespace krot::internal {
namespace {

TEST(CheckArgument, SaysNameValueAndRequirement) {
  try {
    CheckArgument(false, "options.step", -0.5, "> 0");
    FAIL() << "no exception";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "options.step = -0.5, must be > 0");
  }
}

TEST(CheckArgument, IsSilentWhenAllIsWell) {
  EXPECT_NO_THROW(CheckArgument(true, "step", 1, "> 0"));
}

TEST(CancelFlag, MayBeAbsent) {
  EXPECT_FALSE(IsCancelled(nullptr));
  CancelFlag flag{false};
  EXPECT_FALSE(IsCancelled(&flag));
  flag = true;
  EXPECT_TRUE(IsCancelled(&flag));
}

}  // namespace
}  // namespace krot::internal
