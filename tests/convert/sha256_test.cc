#include "krot/convert/model_digest.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <openssl/sha.h>

namespace krot::internal {
namespace {

TEST(Sha256Stream, AgreesWithOpenSslAtEveryLengthAroundItsBlocks) {
  std::mt19937 random(1);
  for (size_t size = 0; size < 300; ++size) {
    std::vector<unsigned char> bytes(size);
    for (unsigned char& byte : bytes)
      byte = static_cast<unsigned char>(random());
    std::array<unsigned char, 32> expected;
    SHA256(bytes.data(), size, expected.data());
    Sha256Stream digest;
    const size_t first = size / 3;
    digest.Append(bytes.data(), first);
    digest.Append(bytes.data() + first, size - first);
    EXPECT_EQ(digest.Finish(), expected) << size;
  }
}

}  // namespace
}  // namespace krot::internal
