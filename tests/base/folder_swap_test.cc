#include "krot/base/write_file.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/temp_folder.h"

namespace krot::internal {
namespace {

using ::testing::IsEmpty;
using Names = std::vector<std::string>;

constexpr auto kReplaceNothing = [](const auto&) { return false; };

TEST(FolderSwap, CreatesTheParentsThatTheTargetLacks) {
  TempFolder folder;
  FolderSwap swap(folder / "a/b/c");
  WriteBytes(swap.staging() / "file", "new");
  swap.Commit(kReplaceNothing);
  EXPECT_EQ(ReadBytes(folder / "a/b/c/file"), "new");
}

TEST(FolderSwap, SharesParentsThatOthersHaveCreatedMeanwhile) {
  TempFolder folder;
  {
    FolderSwap swap(folder / "a/b/c");
    WriteBytes(swap.staging() / "file", "new");
    WriteBytes(folder / "a/b/theirs", "theirs");
    swap.Commit(kReplaceNothing);
  }
  EXPECT_EQ(ReadBytes(folder / "a/b/c/file"), "new");
  EXPECT_EQ(FileNames(folder / "a/b"), (Names{"c", "theirs"}));
  EXPECT_EQ(FileNames(folder.path()), Names{"a"});
}

TEST(FolderSwap, RefusesATargetThatOthersHaveCreatedMeanwhile) {
  TempFolder folder;
  {
    FolderSwap swap(folder / "a/b");
    WriteBytes(swap.staging() / "file", "new");
    WriteBytes(folder / "a/b/theirs", "theirs");
    EXPECT_THROW(swap.Commit(kReplaceNothing), WriteError);
  }
  EXPECT_EQ(FileNames(folder / "a/b"), Names{"theirs"});
  EXPECT_EQ(FileNames(folder.path()), Names{"a"});
}

TEST(FolderSwap, HasNothingToSayOfWhatGoesWell) {
  TempFolder folder;
  Names notes;
  const auto note = [&](const std::string& text) { notes.push_back(text); };
  for (const char* name : {"new", "old"}) {
    WriteBytes(folder / "old/file", "old");
    FolderSwap swap(folder / name, note);
    swap.Commit(kReplaceNothing);
  }
  { FolderSwap unused(folder / "unused", note); }
  EXPECT_THAT(notes, IsEmpty());
}

TEST(RemoveTree, TakesAllThatAFolderHoldsAndFollowsNoLink) {
  TempFolder folder;
  WriteBytes(folder / "kept/file", "kept");
  WriteBytes(folder / "tree/a/b/file", "x");
  std::filesystem::create_directory_symlink(folder / "kept",
                                            folder / "tree/link");
  EXPECT_FALSE(RemoveTree(folder / "tree"));
  EXPECT_EQ(FileNames(folder.path()), Names{"kept"});
  EXPECT_EQ(FileNames(folder / "kept"), Names{"file"});
  EXPECT_FALSE(RemoveTree(folder / "tree")) << "there is none";
}

TEST(FolderEntries, AreItsNamesWithoutItselfAndItsParent) {
  TempFolder folder;
  WriteBytes(folder / ".hidden", "");
  WriteBytes(folder / "file", "");
  EXPECT_THAT(FolderEntries(folder.path()),
              ::testing::UnorderedElementsAre(".hidden", "file"));
  EXPECT_THROW(FolderEntries(folder / "file"),
               std::filesystem::filesystem_error);
}

}  // namespace
}  // namespace krot::internal
