#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "tests/testing/model_matchers.h"

namespace krot::internal {

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
  explicit KrotProcess(const std::vector<std::string>& arguments,
                       uint64_t max_memory_bytes = 0);
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

KrotResult RunKrot(const std::vector<std::string>& arguments,
                   uint64_t max_memory_bytes = 0);

// As a reader sees an error: one line, from this command, saying `part`.
MATCHER_P2(IsOneSentence, speaker, part,
           "is one line that begins with '" + std::string(speaker) +
               ": ' and holds '" + std::string(part) + "'") {
  return arg.find('\n') == arg.size() - 1 &&
         arg.rfind(std::string(speaker) + ": ", 0) == 0 &&
         arg.find(part) != std::string::npos;
}

}  // namespace krot::internal
