#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "krot/base/context.h"

namespace krot::internal {

// Ranks that are threads of this process, for tests.
class ThreadRanks {
 public:
  // Calls body(ranks) on each of so many and rethrows what one has thrown; all
  // must throw, or none.
  static void Run(int count, const std::function<void(Ranks*)>& body) {
    ThreadRanks shared(count);
    std::vector<std::exception_ptr> failures(count);
    std::vector<std::thread> threads;
    for (int rank = 0; rank < count; ++rank) {
      threads.emplace_back([&, rank] {
        Member member(rank, &shared);
        try {
          body(&member);
        } catch (...) {
          failures[rank] = std::current_exception();
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    for (const std::exception_ptr& failure : failures) {
      if (failure) std::rethrow_exception(failure);
    }
  }

 private:
  class Member : public Ranks {
   public:
    Member(int rank, ThreadRanks* shared) : rank_(rank), shared_(*shared) {}

    int rank() const override { return rank_; }
    int count() const override {
      return static_cast<int>(shared_.bytes_.size());
    }
    std::vector<std::string> Exchange(std::vector<std::string> bytes) override {
      shared_.bytes_[rank_] = std::move(bytes);
      shared_.Meet();
      std::vector<std::string> received;
      for (const std::vector<std::string>& from : shared_.bytes_) {
        received.push_back(from[rank_]);
      }
      shared_.Meet();
      return received;
    }

   private:
    const int rank_;
    ThreadRanks& shared_;
  };

  explicit ThreadRanks(int count) : bytes_(count) {}

  // Returns once all have called it.
  void Meet() {
    std::unique_lock<std::mutex> lock(mutex_);
    const int64_t meeting = num_meetings_;
    if (++num_here_ == bytes_.size()) {
      num_here_ = 0;
      ++num_meetings_;
      all_here_.notify_all();
      return;
    }
    all_here_.wait(lock, [&] { return num_meetings_ != meeting; });
  }

  std::vector<std::vector<std::string>> bytes_;  // by sender
  std::mutex mutex_;
  std::condition_variable all_here_;
  size_t num_here_ = 0;
  int64_t num_meetings_ = 0;
};

}  // namespace krot::internal
