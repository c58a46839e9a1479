#include "tools/krot/run_log.h"

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <optional>
#include <system_error>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/system.h"
#include "krot/base/write_file.h"
#include "krot/convert/certificate_file.h"
#include "krot/model/model_io.h"
#include "krot/report/text_table.h"
#include "krot/version.h"
#include "tools/krot/log.h"
#include "tools/krot/machine.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

class RunLog {
 public:
  explicit RunLog(const std::string& file)
      : descriptor_(file, FileDescriptor::Use::kReplace) {
    if (descriptor_.is_open()) return;
    throw WriteError(file + ": cannot be created: " +
                     std::generic_category().message(errno));
  }

  void Plain(const std::string& line) const {
    // A full disk, on which the log no longer fits, does not end the run.
    static_cast<void>(descriptor_.Write(line + '\n'));
  }
  void Timed(const std::string& line) const {
    Plain(FormatNumber(timer_.Seconds(), 3) + " s  " + line);
  }

 private:
  FileDescriptor descriptor_;
  Timer timer_;
};

std::optional<RunLog> run_log;

std::string Now() {
  const std::time_t now = std::time(nullptr);
  char text[32];
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", std::gmtime(&now));
  return text;
}

}  // namespace

void BeginRunLog(const std::string& file, const OptionParser& parser) {
  CheckFileWritable(file);
  run_log.emplace(file);
  run_log->Plain(parser.command() + ", version " KROT_VERSION);
  run_log->Plain("begun " + Now());
  run_log->Plain("machine: " + MachineLine(ThisMachine()) + "; " +
                 SystemName());
  run_log->Plain("working directory: " + fs::current_path().string());
  for (const Option& option : parser.options()) {
    run_log->Plain("--" + option.name + "=" + parser.Text(option.name) +
                   (parser.IsGiven(option.name) ? "" : "  (default)"));
  }
  SetLogSink([](const std::string& line) { run_log->Timed(line); });
}

void LogInput(const fs::path& path) {
  if (!run_log) return;
  std::vector<fs::path> files = {path};
  if (fs::is_directory(path)) {
    files.clear();
    for (const fs::path& name : FolderEntries(path)) {
      if (fs::is_regular_file(path / name)) files.push_back(path / name);
    }
    std::sort(files.begin(), files.end());
  }
  for (const fs::path& file : files) {
    const std::string bytes = ReadFileBytes(file).bytes;
    run_log->Timed("read " + file.string() + ", " +
                   std::to_string(bytes.size()) + " bytes, SHA-256 " +
                   Sha256(bytes));
  }
}

void EndRunLog(int exit_code) {
  if (run_log) run_log->Timed("exit code " + std::to_string(exit_code));
}

}  // namespace krot::internal
