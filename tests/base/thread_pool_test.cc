#include "krot/base/parallel_for.h"

#include <atomic>
#include <cfenv>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

namespace krot::internal {
namespace {

// Where threads wait until `count` of them have come; false after a minute.
class Meeting {
 public:
  explicit Meeting(int count) : missing_(count) {}
  bool Attend() {
    std::unique_lock<std::mutex> lock(mutex_);
    if (--missing_ == 0) all_here_.notify_all();
    return all_here_.wait_for(lock, std::chrono::minutes(1),
                              [&] { return missing_ <= 0; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable all_here_;
  int missing_;
};

// The threads of a call of Run that needs them all at the same time.
std::set<std::thread::id> ThreadsOfRun(int num_workers) {
  Meeting meeting(num_workers);
  std::vector<std::thread::id> ids(num_workers);
  ThreadPool::Get().Run(num_workers, [&](int worker) {
    EXPECT_TRUE(meeting.Attend());
    ids[worker] = std::this_thread::get_id();
  });
  return {ids.begin(), ids.end()};
}

// As the system counts them.
int64_t NumThreadsOfProcess() {
  const std::filesystem::directory_iterator tasks("/proc/self/task");
  return std::distance(begin(tasks), end(tasks));
}

TEST(ThreadPool, GivesACallTheThreadsItAsksForAtTheSameTime) {
  for (const int workers : {1, 2, 5}) {
    EXPECT_EQ(ThreadsOfRun(workers).size(), workers);
  }
}

TEST(ThreadPool, UsesItsThreadsAgain) {
  const std::set<std::thread::id> first = ThreadsOfRun(4);
  const int64_t num_threads = NumThreadsOfProcess();
  for (int n = 0; n < 100; ++n) ThreadsOfRun(1 + n % 4);
  EXPECT_EQ(NumThreadsOfProcess(), num_threads);
  EXPECT_EQ(ThreadsOfRun(4).size(), first.size());
}

TEST(ThreadPool, HasNoThreadWhereOneIsAskedFor) {
  // In a child, whose pool is empty whatever ran before.
  const pid_t child = ::fork();
  if (child == 0) {
    ParallelFor(100, 1, 1, [](int64_t, int64_t, int) {});
    ParallelFor(1, 1, 8, [](int64_t, int64_t, int) {});  // one chunk
    std::_Exit(NumThreadsOfProcess() == 1 ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

TEST(ThreadPool, OfAForkedChildHasThreadsOfItsOwn) {
  ThreadsOfRun(3);
  const pid_t child = ::fork();
  if (child == 0) {
    std::_Exit(ThreadsOfRun(3).size() == 3 && NumThreadsOfProcess() == 3 ? 0
                                                                         : 1);
  }
  int status = -1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(ThreadsOfRun(3).size(), 3);  // nor did the parent lose any
}

TEST(ThreadPool, LetsTheProcessEndWhileItsThreadsSleep) {
  const pid_t child = ::fork();
  if (child == 0) {
    ThreadsOfRun(4);
    std::exit(7);
  }
  int status = -1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 7);
}

TEST(ThreadPool, ServesCallsWithinCalls) {
  std::atomic<int> visits{0};
  ParallelFor(6, 1, 3, [&](int64_t, int64_t, int) {
    ParallelFor(5, 1, 4, [&](int64_t, int64_t, int) {
      ParallelFor(4, 1, 2, [&](int64_t, int64_t, int) { ++visits; });
    });
  });
  EXPECT_EQ(visits, 6 * 5 * 4);
}

TEST(ThreadPool, ServesSeveralCallersAtTheSameTime) {
  // Each meets its own workers, so none may be left to wait for another's.
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 3; ++caller) {
    callers.emplace_back([] {
      for (int n = 0; n < 20; ++n) EXPECT_EQ(ThreadsOfRun(3).size(), 3);
    });
  }
  for (std::thread& caller : callers) caller.join();
}

TEST(ThreadPool, RoundsAsItsCallerDoes) {
  ThreadsOfRun(3);
  for (const int rounding : {FE_UPWARD, FE_DOWNWARD, FE_TONEAREST}) {
    std::fesetround(rounding);
    Meeting meeting(3);
    std::vector<int> roundings(3);
    ThreadPool::Get().Run(3, [&](int worker) {
      EXPECT_TRUE(meeting.Attend());
      roundings[worker] = std::fegetround();
    });
    EXPECT_EQ(roundings, std::vector<int>(3, rounding));
  }
}

}  // namespace
}  // namespace krot::internal
