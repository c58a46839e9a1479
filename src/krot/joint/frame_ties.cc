#include "krot/joint/working_set.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace krot::internal {
namespace {

// The number of tracks that a rank offers at a time.
constexpr size_t kTracksAtOnce = 2048;

int64_t LengthOf(const KnownRotationProblem& problem, int32_t point) {
  return problem.point_begin[point + 1] - problem.point_begin[point];
}

// One rank's next tracks in the order of FindTies. offer[0] is 1 if the rank
// has no more tracks after these, otherwise 0; then follow, for each track, its
// length and its frames.
using Offer = std::vector<int32_t>;

// Reads the tracks of an offer one after the other.
struct Reader {
  const Offer& offer;
  size_t next = 1;

  bool HasMore() const { return next < offer.size(); }
  bool IsAll() const { return offer[0] != 0; }
  int32_t Length() const { return offer[next]; }
  const int32_t* Frames() const { return &offer[next + 1]; }
  void Advance() { next += 1 + static_cast<size_t>(Length()); }
};

class Ties {
 public:
  Ties(const KnownRotationProblem& problem, std::vector<int32_t> others,
       int count, std::vector<int64_t> tied)
      : problem_(problem),
        others_(std::move(others)),
        count_(count),
        tied_(std::move(tied)) {}

  Offer MakeOffer();
  // Takes or rejects the tracks of all ranks' offers, as long as it is known
  // which track comes next. Returns whether any are left.
  bool Decide(const std::vector<Offer>& offers, int rank);

  std::vector<int32_t> Taken() && { return std::move(taken_); }

 private:
  bool IsMissing(int32_t frame) const { return tied_[frame] < count_; }
  bool IsMissing(const Reader& track) const {
    return std::any_of(track.Frames(), track.Frames() + track.Length(),
                       [&](int32_t f) { return IsMissing(f); });
  }

  const KnownRotationProblem& problem_;
  std::vector<int32_t> others_;
  const int count_;
  std::vector<int64_t> tied_;     // per frame
  std::vector<int32_t> offered_;  // undecided points of this rank
  size_t next_ = 0;               // of others_
  std::vector<int32_t> taken_;
};

// Offers only tracks with a frame that still needs ties. The others are dropped
// for good, as the number of ties never falls.
Offer Ties::MakeOffer() {
  Offer offer = {0};
  const auto add = [&](int32_t k) {
    const size_t begin = offer.size();
    offer.push_back(static_cast<int32_t>(LengthOf(problem_, k)));
    bool is_missing = false;
    for (int64_t i = problem_.point_begin[k]; i < problem_.point_begin[k + 1];
         ++i) {
      offer.push_back(problem_.views[problem_.observations[i].view].frame);
      is_missing |= IsMissing(offer.back());
    }
    if (!is_missing) offer.resize(begin);
    return is_missing;
  };
  std::vector<int32_t> offered;
  for (const int32_t k : offered_) {
    if (add(k)) offered.push_back(k);
  }
  while (next_ < others_.size() && offered.size() < kTracksAtOnce) {
    const int32_t k = others_[next_++];
    if (add(k)) offered.push_back(k);
  }
  offered_ = std::move(offered);
  offer[0] = next_ == others_.size() ? 1 : 0;
  return offer;
}

// Takes the longest track of all offers first, and of equal lengths that of the
// lower rank. Once the offer of a rank that has more tracks is used up, it is
// unknown which track comes next.
bool Ties::Decide(const std::vector<Offer>& offers, int rank) {
  std::vector<Reader> readers;
  for (const Offer& offer : offers) readers.push_back({offer});
  size_t num_decided = 0;  // of those offered here
  for (;;) {
    Reader* longest = nullptr;
    for (Reader& reader : readers) {
      if (!reader.HasMore() && reader.IsAll()) continue;
      if (!reader.HasMore()) {
        offered_.erase(offered_.begin(), offered_.begin() + num_decided);
        return true;
      }
      if (longest == nullptr || reader.Length() > longest->Length()) {
        longest = &reader;
      }
    }
    if (longest == nullptr) return false;
    const bool is_here = longest == &readers[rank];
    if (IsMissing(*longest)) {
      for (int32_t n = 0; n < longest->Length(); ++n) {
        ++tied_[longest->Frames()[n]];
      }
      if (is_here) taken_.push_back(offered_[num_decided]);
    }
    if (is_here) ++num_decided;
    longest->Advance();
  }
}

}  // namespace

std::vector<int32_t> FindTies(const KnownRotationProblem& problem,
                              std::vector<int32_t> others, int count,
                              std::vector<int64_t> tied,
                              const Context& context) {
  std::stable_sort(others.begin(), others.end(), [&](int32_t a, int32_t b) {
    return LengthOf(problem, a) > LengthOf(problem, b);
  });
  Ties ties(problem, std::move(others), count, std::move(tied));
  bool is_any_left = true;
  while (is_any_left) {
    const Offer own = ties.MakeOffer();
    is_any_left =
        context.ranks == nullptr
            ? ties.Decide({own}, 0)
            : ties.Decide(context.ranks->ExchangeValues(
                              std::vector<Offer>(context.ranks->count(), own)),
                          context.ranks->rank());
  }
  return std::move(ties).Taken();
}

}  // namespace krot::internal
