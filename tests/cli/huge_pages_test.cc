// Its own executable: with tools/krot/huge_pages.cc, which replaces the global
// operator new, as programs are.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <new>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot::internal {
namespace {

constexpr std::size_t kMebibyte = std::size_t{1} << 20;

// What the system says of the mapping at an address: "VmFlags: rd wr ... hg".
std::string FlagsAt(std::uintptr_t address) {
  std::ifstream maps("/proc/self/smaps");
  bool is_there = false;
  for (std::string line; std::getline(maps, line);) {
    std::istringstream text(line);
    std::uintptr_t begin = 0, end = 0;
    char dash = 0;
    if (text >> std::hex >> begin >> dash >> end && dash == '-') {
      is_there = begin <= address && address < end;
    } else if (is_there && line.rfind("VmFlags:", 0) == 0) {
      return line;
    }
  }
  return "";
}

TEST(HugePages, AreAskedForWhereArraysAreLarge) {
  const std::vector<char> large(2 * kMebibyte + 1, 'x');
  const auto address = reinterpret_cast<std::uintptr_t>(large.data());
  EXPECT_EQ(address % (2 * kMebibyte), 0);
  EXPECT_THAT(FlagsAt(address), ::testing::HasSubstr(" hg"));
}

TEST(HugePages, AreNotAskedForWhereArraysAreSmall) {
  const std::vector<char> small(kMebibyte, 'x');
  EXPECT_THAT(FlagsAt(reinterpret_cast<std::uintptr_t>(small.data())),
              ::testing::Not(::testing::HasSubstr(" hg")));
}

TEST(HugePages, AlignmentIsAsAskedFor) {
  struct alignas(64) Line {
    char bytes[64];
  };
  for (const std::size_t count : {1, 3, 300000}) {
    const auto lines = std::make_unique<Line[]>(count);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(lines.get()) % 64, 0);
    std::memset(lines.get(), 1, count * sizeof(Line));
  }
}

TEST(HugePages, WhatCannotBeServedIsToldAsBefore) {
  volatile const auto too_large =
      static_cast<std::size_t>(std::numeric_limits<std::ptrdiff_t>::max()) -
      kMebibyte;
  EXPECT_THROW(static_cast<void>(std::vector<char>(too_large)), std::bad_alloc);
  EXPECT_EQ(new (std::nothrow) char[too_large], nullptr);
}

TEST(HugePages, NothingHasAnAddressTooAndItsOwn) {
  const std::unique_ptr<char[]> a(new char[0]), b(new char[0]);
  EXPECT_NE(a, nullptr);
  EXPECT_NE(a, b);
}

}  // namespace
}  // namespace krot::internal
