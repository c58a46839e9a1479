#include "krot/base/parallel_for.h"

#include <atomic>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "krot/base/system.h"
#include "tests/testing/temp_folder.h"

namespace krot::internal {
namespace {

TEST(ParallelFor, VisitsEveryItemOnceInFixedChunks) {
  for (const int threads : {1, 2, 3, 8}) {
    for (const int64_t count : {1, 9, 10, 11, 1000}) {
      std::vector<std::atomic<int>> visits(count);
      ParallelFor(count, 10, threads,
                  [&](int64_t begin, int64_t end, int worker) {
                    EXPECT_EQ(begin % 10, 0);
                    EXPECT_EQ(end, std::min<int64_t>(begin + 10, count));
                    EXPECT_GE(worker, 0);
                    EXPECT_LT(worker, threads);
                    for (int64_t i = begin; i < end; ++i) ++visits[i];
                  });
      for (const std::atomic<int>& n : visits) EXPECT_EQ(n, 1);
    }
  }
}

TEST(ParallelFor, DoesNothingForNoItems) {
  const auto fail = [](int64_t, int64_t, int) { FAIL(); };
  ParallelFor(0, 10, 2, fail);
  ParallelFor(-3, 10, 2, fail);
}

TEST(ParallelFor, RethrowsTheFirstExceptionByChunk) {
  for (const int threads : {1, 2, 4}) {
    std::atomic<int> finished{0};
    try {
      ParallelFor(100, 10, threads, [&](int64_t begin, int64_t, int) {
        if (begin == 30 || begin == 70) {
          throw std::runtime_error(std::to_string(begin));
        }
        ++finished;
      });
      FAIL() << "no exception";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "30");
    }
    EXPECT_EQ(finished, 8);
  }
}

TEST(ParallelFor, RethrowsFromACallWithinACall) {
  for (const int threads : {1, 3}) {
    std::atomic<int> caught{0};
    ParallelFor(4, 1, threads, [&](int64_t outer, int64_t, int) {
      try {
        ParallelFor(4, 1, threads, [&](int64_t inner, int64_t, int) {
          if (inner == outer) throw std::runtime_error(std::to_string(inner));
        });
      } catch (const std::runtime_error& error) {
        caught += error.what() == std::to_string(outer);
      }
    });
    EXPECT_EQ(caught, 4);
  }
}

TEST(ParallelFor, RefusesChunksWithoutItems) {
  EXPECT_THROW(ParallelFor(1, 0, 1, [](int64_t, int64_t, int) {}),
               std::invalid_argument);
}

TEST(NumChunks, CountsTheLastIncompleteOne) {
  EXPECT_EQ(NumChunks(0, 10), 0);
  EXPECT_EQ(NumChunks(10, 10), 1);
  EXPECT_EQ(NumChunks(11, 10), 2);
}

TEST(ResolveNumThreads, KeepsPositiveNumbersAndReplacesOthers) {
  EXPECT_EQ(ResolveNumThreads(3), 3);
  EXPECT_GE(ResolveNumThreads(-1), 1);
  EXPECT_GE(ResolveNumThreads(0), 1);
}

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
