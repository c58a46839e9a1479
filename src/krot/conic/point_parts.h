#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/parallel_for.h"
#include "krot/base/ranks.h"

namespace krot {

// Points in parts of about equal work, which grows with the square of the
// track: one part of a FrameSystem's sum each. They depend on the structure
// alone, and on that of the whole where ranks share its points: a part may then
// begin on one rank and end on another.
class PointParts {
 public:
  // `point_begin` as BlockStructure's.
  PointParts(const std::vector<int64_t>& point_begin, int num_parts,
             Ranks* ranks = nullptr)
      : num_parts_(num_parts), ranks_(ranks) {
    const auto num_points = static_cast<int64_t>(point_begin.size()) - 1;
    const auto work = [&](int64_t k) {
      const auto m = static_cast<double>(point_begin[k + 1] - point_begin[k]);
      return m * (m + 10);
    };
    std::vector<double> total(1, 0);  // whole numbers, so exact
    for (int64_t k = 0; k < num_points; ++k) total[0] += work(k);
    Progress progress;
    const auto cut = [&](Progress* so_far) {
      begin_.assign(so_far->num_begun, 0);
      for (int64_t k = 0; k < num_points; ++k) {
        if (so_far->work > total[0] * so_far->num_begun / num_parts) {
          begin_.push_back(k);
          ++so_far->num_begun;
        }
        so_far->work += work(k);
      }
      begin_.resize(num_parts + 1, num_points);
    };
    if (ranks == nullptr) {
      cut(&progress);
      return;
    }
    ranks->Reduce([](double a, double b) { return a + b; }, &total);
    ranks->InTurn(cut, &progress);
    std::vector<char> has_points;
    for (int part = 0; part < num_parts; ++part) {
      has_points.push_back(HasPoints(part));
    }
    has_points_ = ranks->Gather(has_points);
  }

  // Whether any of a part's points is here.
  bool HasPoints(int part) const { return begin_[part] < begin_[part + 1]; }

  // body(k, part) for every point, each part in order on one thread.
  template <typename Body>
  void ForEach(int num_threads, const Body& body) const {
    ParallelFor(num_parts_, 1, num_threads, [&](int64_t part, int64_t, int) {
      ForPart(static_cast<int>(part), body);
    });
  }

  // The same where ranks share the points and a part's sum: `take(part)` is
  // what it is so far, as numbers, and `put(part, numbers)` makes it that. In
  // the end the first rank has all sums.
  template <typename Body, typename Take, typename Put>
  void SumOverRanks(int num_threads, const Body& body, const Take& take,
                    const Put& put) const {
    const auto had = [&](int part) { return HolderBefore(part, Rank()); };
    ParallelFor(num_parts_, 1, num_threads, [&](int64_t n, int64_t, int) {
      const int part = static_cast<int>(n);
      if (had(part) < 0) ForPart(part, body);
    });
    for (int r = 1; r < ranks_->count(); ++r) {
      for (int part = 0; part < num_parts_; ++part) {
        const int from = HolderBefore(part, r);
        if (from < 0 || !IsHolder(part, r)) continue;
        Hand(part, from, r, take, put);
        if (r == Rank()) ForPart(part, body);
      }
    }
    for (int part = 0; part < num_parts_; ++part) {
      const int last = HolderBefore(part, ranks_->count());
      if (last > 0) Hand(part, last, 0, take, put);
    }
  }

 private:
  struct Progress {
    double work = 0;
    int num_begun = 1;  // parts
  };

  template <typename Body>
  void ForPart(int part, const Body& body) const {
    for (int64_t k = begin_[part]; k < begin_[part + 1]; ++k) body(k, part);
  }
  template <typename Take, typename Put>
  void Hand(int part, int from, int to, const Take& take,
            const Put& put) const {
    std::vector<std::vector<double>> numbers(ranks_->count());
    if (from == Rank()) numbers[to] = take(part);
    numbers = ranks_->ExchangeValues(std::move(numbers));
    if (to == Rank()) put(part, numbers[from]);
  }

  int Rank() const { return ranks_->rank(); }
  bool IsHolder(int part, int rank) const {
    return has_points_[rank * num_parts_ + part] != 0;
  }
  // The last of the ranks before one that has points of a part; -1: none.
  int HolderBefore(int part, int rank) const {
    while (--rank >= 0 && !IsHolder(part, rank)) {
    }
    return rank;
  }

  int num_parts_;
  Ranks* ranks_;
  std::vector<int64_t> begin_;
  std::vector<char> has_points_;  // per rank and part
};

}  // namespace krot
