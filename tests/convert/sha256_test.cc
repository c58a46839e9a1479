#include "krot/convert/certificate_file.h"

#include <array>
#include <random>
#include <string>

#include <gtest/gtest.h>
#include <openssl/sha.h>

namespace krot::internal {
namespace {

TEST(Sha256, AgreesWithOpenSslAtEveryLengthAroundItsBlocks) {
  std::mt19937 random(1);
  for (size_t size = 0; size < 300; ++size) {
    std::string bytes(size, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random());
    std::array<unsigned char, 32> digest;
    SHA256(reinterpret_cast<const unsigned char*>(bytes.data()), size,
           digest.data());
    std::string expected;
    for (const unsigned char byte : digest) {
      expected += "0123456789abcdef"[byte >> 4];
      expected += "0123456789abcdef"[byte & 15];
    }
    EXPECT_EQ(Sha256(bytes), expected) << size;
  }
}

}  // namespace
}  // namespace krot::internal
