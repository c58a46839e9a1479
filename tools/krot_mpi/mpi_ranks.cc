#include "tools/krot_mpi/mpi_ranks.h"

#include <mpi.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace krot::internal {
namespace {

// Larger data are sent in several messages, as MPI counts bytes by an int.
constexpr size_t kBytesPerMessage = size_t{1} << 30;

// Calls body(begin, size) for every message that `bytes` bytes take.
template <typename Body>
void ForMessages(size_t bytes, const Body& body) {
  for (size_t begin = 0; begin < bytes; begin += kBytesPerMessage) {
    body(begin, static_cast<int>(std::min(kBytesPerMessage, bytes - begin)));
  }
}

}  // namespace

MpiRanks::MpiRanks(int* argc, char*** argv) {
  MPI_Init(argc, argv);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &count_);
}

MpiRanks::~MpiRanks() { MPI_Finalize(); }

std::vector<std::string> MpiRanks::Exchange(std::vector<std::string> bytes) {
  std::vector<int64_t> sizes, sizes_here(count_);
  for (const std::string& to : bytes) {
    sizes.push_back(static_cast<int64_t>(to.size()));
  }
  MPI_Alltoall(sizes.data(), 1, MPI_INT64_T, sizes_here.data(), 1, MPI_INT64_T,
               MPI_COMM_WORLD);
  std::vector<std::string> received(count_);
  std::vector<MPI_Request> requests;
  for (int r = 0; r < count_; ++r) {
    if (r == rank_) continue;
    received[r].resize(sizes_here[r]);
    ForMessages(received[r].size(), [&](size_t begin, int size) {
      MPI_Irecv(received[r].data() + begin, size, MPI_BYTE, r, 0,
                MPI_COMM_WORLD, &requests.emplace_back());
    });
  }
  for (int r = 0; r < count_; ++r) {
    if (r == rank_) continue;
    bytes_sent_ += sizes[r];
    ForMessages(bytes[r].size(), [&](size_t begin, int size) {
      MPI_Isend(bytes[r].data() + begin, size, MPI_BYTE, r, 0, MPI_COMM_WORLD,
                &requests.emplace_back());
    });
  }
  received[rank_] = std::move(bytes[rank_]);
  MPI_Waitall(static_cast<int>(requests.size()), requests.data(),
              MPI_STATUSES_IGNORE);
  return received;
}

void MpiRanks::Abort(int exit_code) {
  MPI_Abort(MPI_COMM_WORLD, exit_code);
  std::_Exit(exit_code);
}

}  // namespace krot::internal
