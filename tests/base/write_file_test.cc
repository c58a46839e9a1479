#include "krot/base/write_file.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/testing/temp_folder.h"

namespace krot::internal {
namespace {

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

}  // namespace
}  // namespace krot::internal
