// Its own executable: it replaces the global operator new.

#include <atomic>
#include <cstdlib>
#include <new>

#include <gtest/gtest.h>

#include "krot/minimax/fast_descent.h"
#include "tests/testing/random_residuals.h"

namespace {

std::atomic<long> num_allocations{0};

void* Allocate(std::size_t size, std::size_t alignment) {
  ++num_allocations;
  const std::size_t rounded = (size + alignment - 1) / alignment * alignment;
  void* memory = std::aligned_alloc(alignment, rounded);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

// Inlined where `new` is not, it would look to GCC like the wrong way to
// delete.
[[gnu::noinline]] void Release(void* memory) { std::free(memory); }

}  // namespace

void* operator new(std::size_t size) {
  return Allocate(size, alignof(std::max_align_t));
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return Allocate(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { Release(memory); }
void operator delete(void* memory, std::size_t) noexcept { Release(memory); }
void operator delete(void* memory, std::align_val_t) noexcept {
  Release(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  Release(memory);
}

namespace krot::internal {
namespace {

void ExpectNoAllocationOnceWarm(FastDescentSettings settings, double p) {
  FastDescentOptions options;
  options.settings = settings;
  FastDescent descent(options, Norm{p});
  ProblemGenerator generator(1);
  std::vector<ResidualProblem> problems;
  std::vector<Eigen::Vector3d> starts;
  for (int rays = 2; rays <= 60; ++rays) {
    problems.push_back(generator.Triangulation(rays, 5));
    starts.push_back(generator.Start(problems.back(), 0.3));
  }
  const auto solve_all = [&] {
    for (size_t k = 0; k < problems.size(); ++k) {
      Fill(problems[k], &descent.residuals());
      Eigen::Vector3d x = starts[k];
      descent.Minimize(&x);
    }
  };
  solve_all();
  const long before = num_allocations;
  solve_all();
  EXPECT_EQ(num_allocations - before, 0);
}

TEST(Allocation, TheCounterCounts) {
  const long before = num_allocations;
  delete new ResidualProblem;
  EXPECT_GT(num_allocations - before, 0);
}

TEST(Allocation, FastDescentMakesNoneOnceWarm) {
  for (const double p : {1.0, 1.5, 2.0, 3.0, Norm::LInf().p}) {
    ExpectNoAllocationOnceWarm(FastDescentSettings::kFast, p);
  }
}

TEST(Allocation, ProblemsSideBySideMakeNoneOnceWarm) {
  SideBySideDescent descent(FastDescentOptions{}, Norm::L2());
  ProblemGenerator generator(2);
  std::vector<ResidualProblem> problems;
  std::vector<Eigen::Vector3d> starts;
  for (int rays = 2; rays <= 60; ++rays) {
    problems.push_back(generator.Triangulation(rays, 5));
    starts.push_back(generator.Start(problems.back(), 0.3));
  }
  const auto add_rows = [&](int n, SideBySideDescent::RowWriter* writer) {
    for (const Residual& residual : problems[n].residuals) {
      double row[kResidualRow];
      RowOf(residual, row);
      writer->Add(row);
    }
  };
  std::vector<Eigen::Vector3d> x(starts);
  std::vector<ActiveResiduals> active(starts.size());
  std::vector<SideBySideDescent::Problem> tasks;
  for (size_t k = 0; k < starts.size(); ++k)
    tasks.push_back({&x[k], &active[k]});
  descent.Minimize(DescentGoal{}, add_rows, &tasks);
  std::copy(starts.begin(), starts.end(), x.begin());
  std::fill(active.begin(), active.end(), ActiveResiduals{});
  const long before = num_allocations;
  descent.Minimize(DescentGoal{}, add_rows, &tasks);
  EXPECT_EQ(num_allocations - before, 0);
}

TEST(Allocation, PaperSettingsMakeNoneOnceWarm) {
  for (const double p : {1.0, 2.0, Norm::LInf().p}) {
    ExpectNoAllocationOnceWarm(FastDescentSettings::kPaper, p);
  }
}

}  // namespace
}  // namespace krot::internal
