#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

// Where things are written, and where they are not.

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

class Output : public ::testing::Test {
 protected:
  Output() { Save(SmallLegacyModel(), folder_ / "input"); }

  KrotResult Solve(const fs::path& output, const Words& more = {}) const {
    return RunKrot({"solver", "--input_path", folder_ / "input",
                    "--output_path", output, "--ResInt.max_sweeps", "1"},
                   more);
  }

  void ExpectNotWritten(const KrotResult& result, const Words& names,
                        const std::string& part) const {
    EXPECT_EQ(result.exit_code, 5);
    EXPECT_THAT(result.err, IsOneSentence("krot solver", part));
    EXPECT_EQ(FileNames(folder_.path()), names);
  }

  TempFolder folder_;
};

// What `head` does to a pipeline: the pipes that `redirections` join to stdout
// have no reader. The code that the command ends with.
int CodeWithoutReader(const Words& arguments, const std::string& redirections,
                      const fs::path& folder) {
  std::string command = "( sleep 0.2; '" KROT_EXECUTABLE "'";
  for (const std::string& word : arguments) command += " '" + word + "'";
  command +=
      " " + redirections + "; echo $? >'" + folder.string() + "/code' ) | true";
  EXPECT_EQ(std::system(command.c_str()), 0);
  while (!fs::exists(folder / "code") || ReadBytes(folder / "code").empty()) {
    usleep(10000);
  }
  const int code = std::stoi(ReadBytes(folder / "code"));
  fs::remove(folder / "code");
  return code;
}

TEST_F(Output, IsWrittenThoughNobodyReadsWhatIsPrinted) {
  const std::string output = folder_ / "output";
  const Words arguments = {"solver",
                           "--input_path",
                           folder_ / "input",
                           "--output_path",
                           output,
                           "--overwrite",
                           "1"};
  EXPECT_EQ(CodeWithoutReader(arguments, "2>&1", folder_.path()), 141);
  EXPECT_EQ(FileNames(folder_.path()), (Words{"input", "output"}));
  EXPECT_EQ(Load(output).images.size(), Load(folder_ / "input").images.size());
  const std::string printed = "2>&1 >'" + (folder_ / "printed").string() + "'";
  EXPECT_EQ(CodeWithoutReader(arguments, printed, folder_.path()), 0);
  EXPECT_THAT(ReadBytes(folder_ / "printed"), HasSubstr("in all on"));
  // The code says what matters more.
  EXPECT_EQ(CodeWithoutReader({"solver"}, "2>&1", folder_.path()), 1);
}

TEST_F(Output, ReplacesNoDatabaseUnlessAsked) {
  const auto synthesize = [&](const Words& more) {
    return RunKrot({"model_synthesizer", "--output_path", folder_ / "scene",
                    "--database_path", folder_ / "database.db"},
                   more);
  };
  WriteBytes(folder_ / "database.db", "somebody's");
  const KrotResult result = synthesize({});
  EXPECT_EQ(result.exit_code, 5);
  EXPECT_THAT(result.err, IsOneSentence("krot model_synthesizer",
                                        "database.db: is there already"));
  EXPECT_EQ(ReadBytes(folder_ / "database.db"), "somebody's");
  EXPECT_FALSE(fs::exists(folder_ / "scene"));
  Succeeded(synthesize({"--overwrite", "1"}));
  EXPECT_NE(ReadBytes(folder_ / "database.db"), "somebody's");
}

TEST_F(Output, ThatCannotBeWrittenIsRefusedBeforeTheSolve) {
  WriteBytes(folder_ / "file", "");
  const Words names = FileNames(folder_.path());
  ExpectNotWritten(Solve(folder_ / "file"), names, "file");
  ExpectNotWritten(Solve(folder_ / "file/model"), names, "file");
  const auto report = [&](const fs::path& path) {
    return Solve(folder_ / "output", {"--report_path", path});
  };
  ExpectNotWritten(report(folder_ / "missing/r.json"), names, "no folder");
  ExpectNotWritten(report(folder_.path()), names, "is a folder");
  ExpectNotWritten(report("/dev/null"), names, "not a regular file");
  // Nothing can be created there, not even by root.
  ExpectNotWritten(Solve("/proc/output"), names,
                   "/proc: cannot be written to: ");
  ExpectNotWritten(report("/proc/r.json"), names, "/proc is not writable: ");
}

// Splatting programs read it and not points3D.bin.
TEST_F(Output, NamesAPlyThatIsOfAnotherModel) {
  EXPECT_THAT(Solve(folder_ / "output").err, Not(HasSubstr("points3D.ply")));
  const fs::path ply = folder_ / "output/points3D.ply";
  WriteBytes(ply, "ply of the model before");
  const KrotResult result =
      Succeeded(Solve(folder_ / "output", {"--overwrite", "1"}));
  EXPECT_THAT(result.err, HasSubstr("warning: " + ply.string() +
                                    " is older than the model beside it"));
  EXPECT_EQ(ReadBytes(ply), "ply of the model before");
}

TEST_F(Output, ReplacesAModelOnlyIfTold) {
  Save(SmallLegacyModel(), folder_ / "output", ModelFormat::kText);
  WriteBytes(folder_ / "output/notes.md", "mine");
  const std::string before = ReadBytes(folder_ / "output/images.txt");
  EXPECT_THAT(Solve(folder_ / "output"),
              IsRefused(5, "krot solver", "overwrite"));
  EXPECT_EQ(ReadBytes(folder_ / "output/images.txt"), before);

  Succeeded(Solve(folder_ / "output", {"--overwrite", "1"}));
  EXPECT_EQ(FileNames(folder_ / "output"),
            (Words{"cameras.bin", "images.bin", "notes.md", "points3D.bin"}));
  EXPECT_EQ(ReadBytes(folder_ / "output/notes.md"), "mine");
  EXPECT_EQ(FileNames(folder_.path()), (Words{"input", "output"}));
}

TEST_F(Output, MayBeTheInput) {
  const Model before = Load(folder_ / "input");
  Succeeded(Solve(folder_ / "input", {"--overwrite", "true"}));
  EXPECT_THAT(Load(folder_ / "input"), Not(IsModel(before)));
}

TEST_F(Output, TakesTheInputsFormatUnlessTold) {
  WriteBytes(folder_ / "input/project.ini", "image_path=images\n");
  Succeeded(Solve(folder_ / "auto"));
  Succeeded(Solve(folder_ / "text", {"--output_type", "TXT"}));
  EXPECT_EQ(
      FileNames(folder_ / "auto"),
      (Words{"cameras.bin", "images.bin", "points3D.bin", "project.ini"}));
  EXPECT_EQ(
      FileNames(folder_ / "text"),
      (Words{"cameras.txt", "images.txt", "points3D.txt", "project.ini"}));
  EXPECT_THAT(Load(folder_ / "text"), IsModel(Load(folder_ / "auto")));
}

TEST_F(Output, AsTextWarnsOfNamesThatColmapWouldCut) {
  Model model = Load(folder_ / "input");
  model.images[0].name = "a photo.jpg";
  Save(model, folder_ / "input");
  EXPECT_THAT(Solve(folder_ / "text", {"--output_type", "TXT"}).err,
              HasSubstr("warning: 1 image name with white space"));
  EXPECT_EQ(Load(folder_ / "text").images[0].name, "a photo.jpg");
  for (const char* command :
       {"bundle_adjuster", "outlier_filter", "model_checker"}) {
    const KrotResult result = Succeeded(
        RunKrot({command, "--input_path", folder_ / "input", "--output_path",
                 folder_ / command, "--output_type", "TXT"}));
    EXPECT_THAT(result.err, HasSubstr("warning: 1 image name with white space"))
        << command;
  }
}

TEST_F(Output, HoldsTheReportIfToldSo) {
  const fs::path report = folder_ / "output/report.json";
  Succeeded(Solve(folder_ / "output", {"--report_path", report}));
  EXPECT_THAT(ReadBytes(report), HasSubstr("\"cost_final\""));
  // And replaces it next time, with nothing left beside it.
  Succeeded(
      Solve(folder_ / "output", {"--report_path", report, "--overwrite", "1"}));
  EXPECT_EQ(
      FileNames(folder_ / "output"),
      (Words{"cameras.bin", "images.bin", "points3D.bin", "report.json"}));
}

// A solve is not thrown away with its report.
TEST_F(Output, KeepsModelAndCertificateWhereTheReportCannotBeWritten) {
  Succeeded(Solve(folder_ / "expected"));
  // Short enough for a name, too long with what it is called until complete.
  const fs::path report = folder_ / std::string(250, 'r');
  const KrotResult result =
      Solve(folder_ / "output",
            {"--report_path", report, "--html_path", folder_ / "page.html",
             "--certificate_path", folder_ / "certificate.json"});
  EXPECT_EQ(result.exit_code, 5);
  EXPECT_THAT(result.err, ::testing::EndsWith("cannot be written: File name "
                                              "too long\n"));
  EXPECT_EQ(FileNames(folder_.path()),
            (Words{"certificate.json", "expected", "input", "output"}));
  EXPECT_THAT(Load(folder_ / "output"), IsModel(Load(folder_ / "expected")));
}

// The options of a log that are not defaults, but for where things go.
Words LoggedOptions(const std::string& log) {
  std::istringstream lines(log);
  Words options;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("--", 0) != 0) continue;
    if (line.find("  (default)") != std::string::npos) continue;
    if (line.rfind("--output_path", 0) == 0) continue;
    if (line.rfind("--log_path", 0) == 0) continue;
    options.push_back(line);
  }
  return options;
}

TEST_F(Output, CanBeMadeAgainFromTheLog) {
  const fs::path file = folder_ / "run.log";
  Succeeded(Solve(folder_ / "a", {"--log_path", file, "--log_level", "0",
                                  "--Solver.finish", "none"}));
  const std::string log = ReadBytes(file);
  EXPECT_THAT(log, ::testing::StartsWith("krot solver, version "));
  EXPECT_THAT(log, HasSubstr("sweep 1: cost "));
  EXPECT_THAT(log, HasSubstr("max error"));
  EXPECT_THAT(log, ::testing::EndsWith("s  exit code 0\n"));

  Words again = {"solver", "--output_path", folder_ / "b"};
  for (const std::string& option : LoggedOptions(log)) again.push_back(option);
  Succeeded(RunKrot(again));
  EXPECT_THAT(Load(folder_ / "b"), IsModel(Load(folder_ / "a")));
}

TEST_F(Output, IsLoggedWithTheDigestsOfWhatWasReadAndTheRefusal) {
  const fs::path file = folder_ / "run.log";
  const fs::path images = folder_ / "input/images.bin";
  const std::unique_ptr<FILE, int (*)(FILE*)> sum(
      ::popen(("sha256sum < '" + images.string() + "'").c_str(), "r"),
      &::pclose);
  char digest[65] = {};
  ASSERT_EQ(std::fread(digest, 1, 64, sum.get()), 64u);
  fs::resize_file(folder_ / "input/points3D.bin", 20);
  EXPECT_EQ(Solve(folder_ / "a", {"--log_path", file}).exit_code, 2);
  EXPECT_THAT(ReadBytes(file), HasSubstr(digest));
  EXPECT_THAT(ReadBytes(file), HasSubstr("krot solver: "));
  EXPECT_THAT(ReadBytes(file), ::testing::EndsWith("s  exit code 2\n"));
}

TEST_F(Output, SplitsTablesFromProgress) {
  const KrotResult usual = Solve(folder_ / "a");
  EXPECT_THAT(usual.out, HasSubstr("max error"));
  EXPECT_THAT(usual.out, Not(HasSubstr("sweep 1:")));
  EXPECT_THAT(usual.err, HasSubstr("sweep 1: cost "));
  EXPECT_THAT(usual.err, HasSubstr("will be needed"));

  const KrotResult to_stderr = Solve(folder_ / "b", {"--log_to_stderr", "1"});
  EXPECT_EQ(to_stderr.out, "");
  EXPECT_THAT(to_stderr.err, HasSubstr("max error"));

  EXPECT_EQ(Solve(folder_ / "c", {"--log_level", "0"}).err, "");
  EXPECT_THAT(Solve(folder_ / "d", {"--log_level", "2"}).err,
              HasSubstr("writing " + (folder_ / "d").string()));
}

}  // namespace
}  // namespace krot::internal
