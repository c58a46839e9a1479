#include "tools/benchmark/timing.h"

#include <time.h>

#include <algorithm>
#include <cmath>

namespace krot::internal {
namespace {

// The processor time of this thread.
double ThreadSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) +
         1e-9 * static_cast<double>(time.tv_nsec);
}

double SecondsOf(const std::function<void()>& run, int64_t calls) {
  const double start = ThreadSeconds();
  for (int64_t call = 0; call < calls; ++call) run();
  return (ThreadSeconds() - start) / static_cast<double>(calls);
}

// The number of calls that take about `min_seconds`. Also warms up the run.
int64_t CallsFor(const std::function<void()>& run, double min_seconds) {
  if (!(min_seconds > 0)) return 1;
  const double once = std::max(SecondsOf(run, 1), 1e-9);
  return std::max<int64_t>(1, std::llround(min_seconds / once));
}

}  // namespace

double MedianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle]
                                : (values[middle - 1] + values[middle]) / 2;
}

std::vector<double> TimeInterleaved(
    const std::vector<std::function<void()>>& runs, int repeats,
    double min_seconds) {
  std::vector<int64_t> calls;
  for (const auto& run : runs) calls.push_back(CallsFor(run, min_seconds));
  std::vector<std::vector<double>> seconds(runs.size());
  for (int repeat = 0; repeat < repeats; ++repeat) {
    for (size_t i = 0; i < runs.size(); ++i) {
      seconds[i].push_back(SecondsOf(runs[i], calls[i]));
    }
  }
  std::vector<double> medians;
  for (const std::vector<double>& list : seconds) {
    medians.push_back(MedianOf(list));
  }
  return medians;
}

}  // namespace krot::internal
