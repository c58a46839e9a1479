#include "tests/cli/krot_process.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <stdexcept>
#include <thread>

namespace krot::internal {
namespace {

void Redirect(int descriptor, const std::filesystem::path& file) {
  const int target = open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (target < 0 || dup2(target, descriptor) < 0) _exit(126);
  close(target);
}

}  // namespace

KrotProcess::KrotProcess(const Words& arguments, uint64_t max_memory_bytes) {
  Words words = Words{KROT_EXECUTABLE} + arguments;
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  WriteBytes(folder_ / "err", "");

  pid_ = fork();
  if (pid_ < 0) throw std::runtime_error("fork failed");
  if (pid_ > 0) return;
  Redirect(STDOUT_FILENO, folder_ / "out");
  Redirect(STDERR_FILENO, folder_ / "err");
  if (max_memory_bytes > 0) {
    const rlimit limit = {max_memory_bytes, max_memory_bytes};
    if (setrlimit(RLIMIT_AS, &limit) != 0) _exit(125);
    // Each of its threads would ask for more than there is, again and again.
    setenv("OPENBLAS_NUM_THREADS", "1", 1);
  }
  execv(argv[0], argv.data());
  _exit(127);
}

KrotProcess::~KrotProcess() {
  if (has_ended_) return;
  Signal(SIGKILL);
  waitpid(pid_, &status_, 0);
}

void KrotProcess::Signal(int signal) const { kill(pid_, signal); }

void KrotProcess::WaitForErrorText(const std::string& text) {
  while (ReadBytes(folder_ / "err").find(text) == std::string::npos) {
    if (waitpid(pid_, &status_, WNOHANG) == pid_) {
      has_ended_ = true;
      return;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

KrotResult KrotProcess::Wait() {
  if (!has_ended_) waitpid(pid_, &status_, 0);
  has_ended_ = true;
  return {WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_),
          ReadBytes(folder_ / "out"), ReadBytes(folder_ / "err")};
}

KrotResult RunKrot(const Words& arguments, const Words& more) {
  return KrotProcess(arguments + more).Wait();
}

KrotResult Succeeded(KrotResult result) {
  if (result.exit_code != 0) throw std::runtime_error(result.err);
  return result;
}

}  // namespace krot::internal
