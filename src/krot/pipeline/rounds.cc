#include "krot/pipeline/rounds.h"

#include <utility>

namespace krot {
namespace {

// Steps tried: 1, then shorter ones by this factor, until they get worse.
constexpr double kShorter = 0.7;
constexpr double kShortestStep = 1e-3;

Estimate Between(const Estimate& from, const Estimate& to, double step) {
  Estimate estimate = from;
  for (size_t f = 0; f < from.translations.size(); ++f) {
    estimate.translations[f] +=
        step * (to.translations[f] - from.translations[f]);
  }
  for (size_t k = 0; k < from.points.size(); ++k) {
    estimate.points[k] += step * (to.points[k] - from.points[k]);
  }
  return estimate;
}

}  // namespace

Estimate BestOnSegment(const Reprojection& reprojection, const Estimate& from,
                       const Estimate& to, Norm norm, int num_threads,
                       double* step, double* true_cost) {
  Estimate best = from;
  *step = 0;
  *true_cost = reprojection.TrueCost(from, norm, num_threads);
  for (double trial = 1; trial >= kShortestStep; trial *= kShorter) {
    Estimate candidate = trial == 1 ? to : Between(from, to, trial);
    const double cost = reprojection.TrueCost(candidate, norm, num_threads);
    if (cost < *true_cost) {
      best = std::move(candidate);
      *true_cost = cost;
      *step = trial;
    } else if (*step > 0) {
      break;
    }
  }
  return best;
}

}  // namespace krot
