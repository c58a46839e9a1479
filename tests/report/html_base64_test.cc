#include "krot/report/html_page.h"

#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

std::string Encode(const std::string& text) {
  return Base64(reinterpret_cast<const unsigned char*>(text.data()),
                text.size());
}

TEST(Base64, EncodesTheTestVectorsOfRfc4648) {
  EXPECT_EQ(Encode(""), "");
  EXPECT_EQ(Encode("f"), "Zg==");
  EXPECT_EQ(Encode("fo"), "Zm8=");
  EXPECT_EQ(Encode("foo"), "Zm9v");
  EXPECT_EQ(Encode("foob"), "Zm9vYg==");
  EXPECT_EQ(Encode("fooba"), "Zm9vYmE=");
  EXPECT_EQ(Encode("foobar"), "Zm9vYmFy");
}

TEST(Base64, EncodesHighBitsAndNumbersLittleEndian) {
  EXPECT_EQ(Encode("\xff\xff\xfe\xfb"), "///++w==");
  EXPECT_EQ(Base64(std::vector<uint32_t>{1, 0xff000000}), "AQAAAAAAAP8=");
}

}  // namespace
}  // namespace krot::internal
