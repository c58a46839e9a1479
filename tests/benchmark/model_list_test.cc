#include "tools/benchmark/model_list.h"

#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot::internal {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

BenchmarkOptions Models(const std::vector<std::string>& paths) {
  BenchmarkOptions options;
  options.log.level = 0;
  options.input_paths = paths;
  return options;
}

TEST(MeasureModels, NamesWhatItLeavesOutAndGoesOn) {
  std::vector<std::string> measured;
  const auto left_out =
      MeasureModels(Models({"a", "b", "c"}), [&](const std::string& path) {
        if (path == "b") throw std::runtime_error("b is broken");
        measured.push_back(path);
      });
  EXPECT_THAT(measured, ElementsAre("a", "c"));
  EXPECT_THAT(left_out, ElementsAre(HasSubstr("b is broken")));
}

TEST(MeasureModels, FailsWhereNoModelIsLeft) {
  EXPECT_THROW(MeasureModels(Models({"a", "b"}),
                             [](const std::string& path) {
                               throw std::invalid_argument(path);
                             }),
               std::invalid_argument);
}

TEST(MeasureModels, IsContentWithoutAny) {
  EXPECT_TRUE(MeasureModels(Models({}), [](const std::string&) {}).empty());
}

}  // namespace
}  // namespace krot::internal
