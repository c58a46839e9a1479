#include "krot/base/write_file.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/temp_folder.h"

namespace krot::internal {
namespace {

using ::testing::IsEmpty;

TEST(WriteFile, ReplacesAFileAndLeavesNothingBesideIt) {
  TempFolder folder;
  WriteBytes(folder / "report.json", "old");
  CheckFileWritable(folder / "report.json");
  WriteFileAtomically(folder / "report.json", "new");
  EXPECT_EQ(ReadBytes(folder / "report.json"), "new");
  EXPECT_EQ(FileNames(folder.path()), std::vector<std::string>{"report.json"});
}

TEST(WriteFile, ReportsAFullDisk) {
  try {
    WriteFile("/dev/full", "bytes");
    ADD_FAILURE() << "nothing was thrown";
  } catch (const WriteError& error) {
    EXPECT_STREQ(error.what(),
                 "/dev/full: cannot be written: No space left on device");
  }
}

TEST(WriteFile, FailsWithoutATraceWhereThereIsNoFolder) {
  TempFolder folder;
  EXPECT_THROW(CheckFileWritable(folder / "a/report.json"), WriteError);
  EXPECT_THROW(WriteFileAtomically(folder / "a/report.json", "x"), WriteError);
  EXPECT_TRUE(FileNames(folder.path()).empty());
}

TEST(WriteFile, MayLieInAFolderThatWillExist) {
  TempFolder folder;
  EXPECT_NO_THROW(CheckFileWritable(folder / "a/report.json", folder / "a/"));
  EXPECT_THROW(CheckFileWritable(folder / "a/report.json", folder / "b"),
               WriteError);
}

TEST(WriteFile, IsTriedWithoutATrace) {
  TempFolder folder;
  EXPECT_FALSE(TryToCreateIn(folder.path()));
  EXPECT_TRUE(FileNames(folder.path()).empty());
  // Where root may do everything, and can do nothing.
  EXPECT_TRUE(TryToCreateIn("/proc"));
  EXPECT_THROW(CheckFileWritable("/proc/report.json"), WriteError);
}

TEST(WriteFile, DoesNotReplaceFoldersAndDevices) {
  TempFolder folder;
  EXPECT_THROW(CheckFileWritable(folder.path()), WriteError);
  EXPECT_THROW(CheckFileWritable(folder / ""), WriteError);
  EXPECT_THROW(CheckFileWritable("/dev/null"), WriteError);
}

TEST(WriteFile, WithoutAFolderInItsNameLiesInTheWorkingFolder) {
  EXPECT_NO_THROW(CheckFileWritable("krot_report_that_is_not_there.json"));
}

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
