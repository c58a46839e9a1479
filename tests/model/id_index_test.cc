#include "krot/model/rigs.h"

#include <limits>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

struct Record {
  uint64_t id;
};

// Consecutive ids are looked up in a table, sparse ones in a sorted list.
const std::vector<Record> kDense = {{3}, {0}, {7}};
const std::vector<Record> kSparse = {
    {std::numeric_limits<uint64_t>::max()}, {5}, {1000000007}};

TEST(IdIndex, FindsWhatIsThereAndNothingElse) {
  for (const auto& records : {kDense, kSparse}) {
    const IdIndex<uint64_t> index(records);
    for (size_t i = 0; i < records.size(); ++i) {
      EXPECT_EQ(index.Find(records[i].id), static_cast<int32_t>(i));
    }
    for (const uint64_t id :
         {uint64_t{1}, uint64_t{6}, uint64_t{8}, uint64_t{1} << 63}) {
      EXPECT_EQ(index.Find(id), std::nullopt);
    }
    EXPECT_EQ(index.duplicate(), std::nullopt);
  }
}

TEST(IdIndex, NamesADuplicateAndFindsTheFirst) {
  for (std::vector<Record> records : {kDense, kSparse}) {
    const uint64_t id = records[1].id;
    records.push_back({id});
    const IdIndex<uint64_t> index(records);
    EXPECT_EQ(index.duplicate(), id);
    EXPECT_EQ(index.Find(id), 1);
  }
}

TEST(IdIndex, OfNothingFindsNothing) {
  EXPECT_EQ(IdIndex<uint64_t>(std::vector<Record>()).Find(0), std::nullopt);
}

}  // namespace
}  // namespace krot::internal
