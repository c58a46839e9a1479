#include "krot/base/system.h"

#include <gtest/gtest.h>

#include "tests/testing/temp_folder.h"

namespace krot::internal {
namespace {

using Use = FileDescriptor::Use;

TEST(FileDescriptor, ReadsFromAnyPlaceAsManyBytesAsThereAre) {
  TempFolder folder;
  WriteBytes(folder / "file", "abcdef");
  const FileDescriptor file(folder / "file", Use::kRead);
  std::string bytes;
  ASSERT_TRUE(file.ReadAt(2, 3, &bytes));
  EXPECT_EQ(bytes, "cde");
  ASSERT_TRUE(file.ReadAt(4, 100, &bytes));
  EXPECT_EQ(bytes, "ef");
  EXPECT_EQ(file.RegularSize(), 6);
}

TEST(FileDescriptor, WritesOnBehindWhatATruncationLeaves) {
  TempFolder folder;
  WriteBytes(folder / "file", "abcdef");
  {
    const FileDescriptor file(folder / "file", Use::kUpdate);
    std::string bytes;
    ASSERT_TRUE(file.ReadAt(0, 6, &bytes));
    ASSERT_TRUE(file.Truncate(2) && file.Write("xyz") && file.Write("!"));
  }
  EXPECT_EQ(ReadBytes(folder / "file"), "abxyz!");
}

TEST(FileDescriptor, OfAFolderHasNoSize) {
  TempFolder folder;
  EXPECT_EQ(FileDescriptor(folder.path(), Use::kRead).RegularSize(),
            std::nullopt);
}

TEST(FileDescriptor, IsLockedByOneAtATime) {
  TempFolder folder;
  const FileDescriptor first(folder / "file", Use::kUpdate);
  {
    const FileDescriptor second(folder / "file", Use::kUpdate);
    EXPECT_TRUE(first.Lock());
    EXPECT_FALSE(second.Lock());
  }
  EXPECT_TRUE(first.Lock());
}

// Linux counts pages in lots, so neither number is exact.
TEST(Process, HoldsAtLeastWhatItHasFilled) {
  constexpr int64_t kMegabyte = int64_t{1} << 20;
  const std::string filled(64 * kMegabyte, 'x');
  EXPECT_GT(ResidentBytes(), 60 * kMegabyte);
  EXPECT_GT(PeakMemoryBytes(), 60 * kMegabyte);
  EXPECT_GT(FreeMemoryBytes(), 0);
  EXPECT_EQ(filled.back(), 'x');
}

}  // namespace
}  // namespace krot::internal
