#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/parallel_for.h"

namespace krot::internal {

// Loops and sums whose result has the same bits at any number of threads, and
// at any number of ranks that share the points. Each rank loops over its own
// observations or points; sums are over all ranks, added up in one fixed order.

// Loops over observations, in chunks of a fixed size.
class ObservationLoop {
 public:
  ObservationLoop(int64_t count, int num_threads)
      : count_(count), num_threads_(num_threads), whole_count_(count) {}
  ObservationLoop(int64_t count, const Context& context)
      : ObservationLoop(count, context.num_threads) {
    ranks_ = context.ranks;
    whole_count_ = SumOfRanks(context, count);
    if (ranks_ != nullptr) first_ = ranks_->SumBefore(count);
  }

  int64_t count() const { return count_; }
  int64_t whole_count() const { return whole_count_; }
  int num_threads() const { return num_threads_; }

  template <typename Body>
  void ForEach(const Body& body) const {  // body(i)
    ParallelFor(count_, kChunk, num_threads_,
                [&](int64_t begin, int64_t end, int) {
                  for (int64_t i = begin; i < end; ++i) body(i);
                });
  }

  template <typename Term>
  double Sum(const Term& term) const {  // sum of term(i)
    return Reduce(0.0, term, [](double a, double b) { return a + b; });
  }

  template <typename Term>
  double Min(const Term& term) const {  // infinity if there are none
    return Reduce(std::numeric_limits<double>::infinity(), term,
                  [](double a, double b) { return std::min(a, b); });
  }

  // combine(... combine(start, term(0)) ..., term(count - 1)), chunk by chunk.
  // `start` must be neutral: combine(start, x) is x.
  template <typename Value, typename Term, typename Combine>
  Value Reduce(const Value& start, const Term& term,
               const Combine& combine) const {
    // Chunks count from the first observation of all ranks. If a chunk begins
    // on one rank and ends on another, both add up their parts, one after the
    // other. `head` is the number of observations here before the first chunk
    // that begins here.
    const int64_t head = std::min(count_, (kChunk - first_ % kChunk) % kChunk);
    std::vector<Value> parts(NumChunks(count_ - head, kChunk), start);
    const auto add = [&](int64_t begin, int64_t end, Value value) {
      for (int64_t i = begin; i < end; ++i) value = combine(value, term(i));
      return value;
    };
    ParallelFor(count_ - head, kChunk, num_threads_,
                [&](int64_t begin, int64_t end, int) {
                  parts[begin / kChunk] = add(head + begin, head + end, start);
                });
    OpenSum<Value> sum{start, start};
    const auto add_parts = [&](OpenSum<Value>* so_far) {
      const auto close = [&](int64_t end) {
        if ((first_ + end) % kChunk != 0 && first_ + end != whole_count_) {
          return;
        }
        so_far->closed = combine(so_far->closed, so_far->open);
        so_far->open = start;
      };
      if (head > 0) {
        so_far->open = add(0, head, so_far->open);
        close(head);
      }
      for (size_t n = 0; n < parts.size(); ++n) {
        so_far->open = parts[n];
        close(std::min(count_, head + static_cast<int64_t>(n + 1) * kChunk));
      }
    };
    if (ranks_ == nullptr) {
      add_parts(&sum);
    } else {
      ranks_->InTurn(add_parts, &sum);
    }
    return sum.closed;
  }

 private:
  static constexpr int64_t kChunk = 4096;

  template <typename Value>
  struct OpenSum {
    Value closed;  // of all complete chunks
    Value open;    // of the present, incomplete chunk
  };

  int64_t count_;
  int num_threads_;
  int64_t whole_count_;
  Ranks* ranks_ = nullptr;
  int64_t first_ = 0;  // number of observations on the ranks before
};

// Loops over points, in parts of about equal work, which grows with the square
// of a track's length. The parts depend only on the tracks of all ranks. Where
// ranks share the points, a part may begin on one rank and end on another.
class PointParts {
 public:
  // `point_begin` has the first observation of each point, and the end.
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

  // body(k, part) for every point, each part in order on one thread.
  template <typename Body>
  void ForEach(int num_threads, const Body& body) const {
    ParallelFor(num_parts_, 1, num_threads, [&](int64_t part, int64_t, int) {
      ForPart(static_cast<int>(part), body);
    });
  }

  // The same for a body that adds to (*sums)[part], which are `size` numbers
  // that start at 0. Where ranks share the points, a part's sum is passed from
  // rank to rank, and in the end only the first rank has the sums.
  template <typename Body>
  void Sum(int num_threads, int64_t size, const Body& body,
           std::vector<std::vector<double>>* sums) const {
    sums->resize(num_parts_);
    for (int part = 0; part < num_parts_; ++part) {
      if (ranks_ != nullptr && !ranks_->IsFirst() && !HasPoints(part)) continue;
      (*sums)[part].assign(size, 0.0);
    }
    if (ranks_ == nullptr) return ForEach(num_threads, body);
    ParallelFor(num_parts_, 1, num_threads, [&](int64_t n, int64_t, int) {
      const int part = static_cast<int>(n);
      if (HolderBefore(part, Rank()) < 0) ForPart(part, body);
    });
    for (int r = 1; r < ranks_->count(); ++r) {
      for (int part = 0; part < num_parts_; ++part) {
        const int from = HolderBefore(part, r);
        if (from < 0 || !IsHolder(part, r)) continue;
        HandOver(from, r, &(*sums)[part]);
        if (r == Rank()) ForPart(part, body);
      }
    }
    for (int part = 0; part < num_parts_; ++part) {
      const int last = HolderBefore(part, ranks_->count());
      if (last > 0) HandOver(last, 0, &(*sums)[part]);
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
  void HandOver(int from, int to, std::vector<double>* numbers) const {
    std::vector<std::vector<double>> sent(ranks_->count());
    if (from == Rank()) sent[to] = std::move(*numbers);
    sent = ranks_->ExchangeValues(std::move(sent));
    if (to == Rank()) *numbers = std::move(sent[from]);
  }

  bool HasPoints(int part) const { return begin_[part] < begin_[part + 1]; }
  int Rank() const { return ranks_->rank(); }
  bool IsHolder(int part, int rank) const {
    return has_points_[rank * num_parts_ + part] != 0;
  }
  // The last rank before `rank` that has points of the part; -1 if none has.
  int HolderBefore(int part, int rank) const {
    while (--rank >= 0 && !IsHolder(part, rank)) {
    }
    return rank;
  }

  int num_parts_;
  Ranks* ranks_;
  std::vector<int64_t> begin_;
  std::vector<char> has_points_;  // per rank and part: whether it has any
};

}  // namespace krot::internal
