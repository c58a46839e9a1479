#include "krot/joint/known_multipliers.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace krot::internal {
namespace {

bool HasSmallerName(const CertifiedObservation& a,
                    const CertifiedObservation& b) {
  return a.observation < b.observation;
}

}  // namespace

void KnownMultipliers::Keep(const std::vector<int64_t>& names,
                            const std::vector<Multiplier>& multipliers,
                            double optimum) {
  optimum_ = {optimum};
  std::vector<CertifiedObservation> kept(names.size());
  for (size_t i = 0; i < names.size(); ++i) {
    kept[i] = {names[i], multipliers[i].lambda, multipliers[i].y};
  }
  std::vector<CertifiedObservation> all;
  all.reserve(kept.size() + known_.size());
  // Of equal names it takes the first range's.
  std::set_union(kept.begin(), kept.end(), known_.begin(), known_.end(),
                 std::back_inserter(all), HasSmallerName);
  known_ = std::move(all);
}

std::vector<Multiplier> KnownMultipliers::Of(
    const std::vector<int64_t>& names) const {
  std::vector<Multiplier> multipliers;
  auto next = known_.begin();
  for (size_t i = 0; i < names.size() && next != known_.end(); ++i) {
    while (next != known_.end() && next->observation < names[i]) ++next;
    if (next == known_.end() || next->observation != names[i]) continue;
    multipliers.resize(names.size());
    multipliers[i] = {next->lambda, next->y};
  }
  return multipliers;
}

}  // namespace krot::internal
