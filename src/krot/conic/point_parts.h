#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/parallel_for.h"

namespace krot {

// Points in parts of about equal work, which grows with the square of the
// track: one part of a FrameSystem's sum each. They depend on the structure
// alone.
class PointParts {
 public:
  // `point_begin` as BlockStructure's.
  PointParts(const std::vector<int64_t>& point_begin, int num_parts)
      : num_parts_(num_parts), begin_(1, 0) {
    const auto num_points = static_cast<int64_t>(point_begin.size()) - 1;
    const auto work = [&](int64_t k) {
      const auto m = static_cast<double>(point_begin[k + 1] - point_begin[k]);
      return m * (m + 10);
    };
    double total = 0;
    for (int64_t k = 0; k < num_points; ++k) total += work(k);
    double sum = 0;
    for (int64_t k = 0; k < num_points; ++k) {
      if (sum > total * static_cast<double>(begin_.size()) / num_parts) {
        begin_.push_back(k);
      }
      sum += work(k);
    }
    begin_.resize(num_parts + 1, num_points);
  }

  // body(k, part) for every point, each part in order on one thread.
  template <typename Body>
  void ForEach(int num_threads, const Body& body) const {
    ParallelFor(num_parts_, 1, num_threads, [&](int64_t part, int64_t, int) {
      for (int64_t k = begin_[part]; k < begin_[part + 1]; ++k) {
        body(k, static_cast<int>(part));
      }
    });
  }

 private:
  int num_parts_;
  std::vector<int64_t> begin_;
};

}  // namespace krot
