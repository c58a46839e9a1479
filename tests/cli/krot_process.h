#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "tests/testing/model_matchers.h"

namespace krot::internal {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;
using Words = std::vector<std::string>;

inline Words operator+(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

inline Json ReadJson(const std::filesystem::path& file) {
  return Json::parse(ReadBytes(file));
}

// What a finished run of `krot` left behind.
struct KrotResult {
  // What it returned; -n if signal n ended it.
  int exit_code = 0;
  std::string out;
  std::string err;
};

// A running `krot`, the one that this build made.
class KrotProcess {
 public:
  // `max_memory_bytes` bounds its address space; 0: no bound.
  explicit KrotProcess(const Words& arguments, uint64_t max_memory_bytes = 0);
  KrotProcess(const KrotProcess&) = delete;
  KrotProcess& operator=(const KrotProcess&) = delete;
  ~KrotProcess();

  void Signal(int signal) const;

  // Returns once stderr holds `text`, or after the process has ended.
  void WaitForErrorText(const std::string& text);

  KrotResult Wait();

 private:
  TempFolder folder_;
  pid_t pid_ = -1;
  bool has_ended_ = false;
  int status_ = 0;
};

KrotResult RunKrot(const Words& arguments, const Words& more = {});

// A result of exit code 0; any other ends the test.
KrotResult Succeeded(KrotResult result);

// As a reader sees an error: one line, from this command, saying `part`.
MATCHER_P2(IsOneSentence, speaker, part,
           "is one line that begins with '" + std::string(speaker) +
               ": ' and holds '" + std::string(part) + "'") {
  return arg.find('\n') == arg.size() - 1 &&
         arg.rfind(std::string(speaker) + ": ", 0) == 0 &&
         arg.find(part) != std::string::npos;
}

// The result of a command that ends with this code and that sentence.
MATCHER_P3(IsRefused, exit_code, speaker, part, "") {
  *result_listener << "ends with " << arg.exit_code << ": " << arg.err;
  return ::testing::ExplainMatchResult(IsOneSentence(speaker, part), arg.err,
                                       result_listener) &&
         arg.exit_code == exit_code;
}

}  // namespace krot::internal
