#include "tools/benchmark/process.h"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>
#include <system_error>

#include "krot/base/context.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

constexpr int kNotFound = 127;

// Called in the child process; replaces it by the program and never returns.
[[noreturn]] void Become(const std::vector<char*>& arguments) {
  const int null = open("/dev/null", O_RDWR);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    dup2(null, stream);
  }
  setenv("QT_QPA_PLATFORM", "offscreen", 1);
  execvp(arguments.front(), arguments.data());
  _exit(kNotFound);
}

}  // namespace

ProcessResult RunProcess(const std::vector<std::string>& arguments) {
  std::vector<char*> pointers;
  for (const std::string& argument : arguments) {
    pointers.push_back(const_cast<char*>(argument.c_str()));
  }
  pointers.push_back(nullptr);
  const Timer timer;
  const pid_t pid = fork();
  if (pid < 0) throw std::runtime_error("no process can be made");
  if (pid == 0) Become(pointers);
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  ProcessResult result;
  result.seconds = timer.Seconds();
  result.exit_code =
      WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  return result;
}

ScratchFolder::ScratchFolder() {
  std::string name =
      (fs::temp_directory_path() / "krot_benchmark_XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) {
    throw std::runtime_error("no folder can be made in " +
                             fs::temp_directory_path().string());
  }
  path_ = name;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

std::string SiblingExecutable(const std::string& name) {
  return (fs::read_symlink("/proc/self/exe").parent_path() / name).string();
}

}  // namespace krot::internal
