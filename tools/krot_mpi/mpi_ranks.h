#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "krot/base/context.h"

namespace krot::internal {

// The processes that mpirun started. The constructor initialises MPI and the
// destructor ends it, so only one object may exist in a process.
class MpiRanks : public Ranks {
 public:
  MpiRanks(int* argc, char*** argv);
  ~MpiRanks() override;
  MpiRanks(const MpiRanks&) = delete;
  MpiRanks& operator=(const MpiRanks&) = delete;

  int rank() const override { return rank_; }
  int count() const override { return count_; }
  std::vector<std::string> Exchange(std::vector<std::string> bytes) override;

  // The number of bytes that this rank has sent to others so far.
  int64_t bytes_sent() const { return bytes_sent_; }

  // Ends all ranks.
  [[noreturn]] void Abort(int exit_code);

 private:
  int rank_ = 0;
  int count_ = 1;
  int64_t bytes_sent_ = 0;
};

}  // namespace krot::internal
