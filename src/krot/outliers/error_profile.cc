#include "krot/outliers/outlier_filter.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "krot/analysis/noise.h"
#include "krot/base/check.h"
#include "krot/finish/least_squares.h"
#include "krot/outliers/packing.h"
#include "krot/outliers/removal.h"
#include "krot/outliers/robust_start.h"

namespace krot::internal {
namespace {

constexpr int kNumLevels = 6;  // about, below the first

class Profiler {
 public:
  Profiler(const Model& model, const BuiltProblem& built,
           const ErrorProfileOptions& options, const Context& context)
      : model_(model),
        built_(built),
        options_(options),
        context_(context),
        search_(model, built, options.norm, context) {
    profile_.noise = FindNoiseLimit(model, built, options.norm, context);
  }

  ErrorProfile Run() {
    Removal nothing;
    nothing.estimate = built_.start;
    const auto at_level = [this](int n) {
      return context_.Within("error profile, level " + std::to_string(n) +
                             " of about " + std::to_string(kNumLevels));
    };
    profile_.levels.push_back(Solve(std::move(nothing), at_level(0)));
    const double first = profile_.levels[0].max_error;
    const double noise = profile_.noise.max_error;
    const bool has_outliers = profile_.levels[0].lower_bound > noise;
    const double last = options_.max_error.value_or(
        has_outliers ? std::min(noise, first / 2) : first / 2);
    for (int n = 0; !context_.IsCancelled(); ++n) {
      const double now = profile_.levels.back().max_error;
      if (!(now > last) || !std::isfinite(now)) break;
      const double steps = std::max(1, kNumLevels - n);
      double bound = std::max(last, now * std::pow(last / now, 1 / steps));
      if (noise < now) bound = std::max(bound, noise);
      // A few programmes are enough where the last level's weights are at hand.
      ProfileLevel level =
          Solve(search_.Find(bound, /*max_programmes=*/n == 0 ? 4 : 2),
                at_level(n + 1));
      if (context_.IsCancelled() || !(level.max_error < now)) break;
      Charge(&level);
      Append(std::move(level));
    }
    for (size_t n = 1; has_outliers && n < profile_.levels.size(); ++n) {
      if (profile_.levels[n].max_error > noise) continue;
      profile_.elbow = n;
      break;
    }
    return std::move(profile_);
  }

 private:
  // The optimum of what a removal leaves.
  ProfileLevel Solve(Removal removal, const Context& context) const {
    OptimumWithout optimum =
        SolveWithout(model_, built_, removal.observations, removal.estimate,
                     options_.norm, context);
    ProfileLevel level;
    level.removal = std::move(removal);
    level.removal.estimate = std::move(optimum.estimate);
    level.max_error = optimum.max_error;
    level.lower_bound = optimum.lower_bound;
    level.proof = std::move(optimum.proof);
    return level;
  }

  void Charge(ProfileLevel* level) {
    if (level->removal.observations.size() <= 50) {
      profile_.conflicts =
          PackAgainstRemoval(model_, built_, {options_.norm, level->max_error},
                             level->removal, std::move(profile_.conflicts),
                             context_)
              .conflicts;
    }
    level->num_proved = static_cast<int64_t>(profile_.conflicts.size());
  }

  // Appends a level; earlier ones that removed no fewer observations are
  // dropped.
  void Append(ProfileLevel level) {
    std::vector<ProfileLevel>& levels = profile_.levels;
    while (levels.size() > 1 && levels.back().removal.observations.size() >=
                                    level.removal.observations.size()) {
      levels.pop_back();
    }
    levels.push_back(std::move(level));
  }

  const Model& model_;
  const BuiltProblem& built_;
  const ErrorProfileOptions& options_;
  const Context& context_;
  RemovalSearch search_;
  ErrorProfile profile_;
};

NoiseLimit LimitOf(const Model& model, Norm norm, const Context& context) {
  NoiseLimit limit;
  limit.max_error = kLeastNoisePx;
  const ModelNoise noise = SnoopNoise(model, {}, context).noise;
  if (!noise.sigma_px) return limit;
  limit.sigma = *noise.sigma_px;
  // ||e||_1 <= sqrt(2) ||e||_2.
  const double factor = norm.p == 1 ? std::sqrt(2.0) : 1;
  const auto count = static_cast<double>(noise.num_tested);
  limit.max_error =
      std::max(kLeastNoisePx,
               factor * limit.sigma * std::sqrt(2 * std::log(count / 0.05)));
  return limit;
}

}  // namespace

NoiseLimit FindNoiseLimit(const Model& model, const BuiltProblem& built,
                          Norm norm, const Context& context) {
  const NoiseLimit own = LimitOf(model, norm, context);
  context.Stage("measuring the noise");
  Estimate robust = FindRobustStart(
      built.problem, norm, std::min(kLevelOfStart, own.max_error), context);
  MinimizeRobustly(built.problem, context, &robust);
  const NoiseLimit limit =
      LimitOf(ApplyEstimate(model, built, robust), norm, context);
  const bool is_lower = limit.sigma > 0 && !(limit.sigma >= own.sigma);
  return is_lower || own.sigma == 0 ? limit : own;
}

NoiseLimit NoiseLimitAtStart(const Model& model, const BuiltProblem& built,
                             Norm norm, const Context& context) {
  return LimitOf(ApplyEstimate(model, built, built.start), norm, context);
}

ErrorProfile FindErrorProfile(const Model& model, const BuiltProblem& built,
                              const ErrorProfileOptions& options,
                              const Context& context) {
  CheckArgument(!options.max_error || *options.max_error > 0, "max_error",
                options.max_error.value_or(0), "> 0");
  return Profiler(model, built, options, context).Run();
}

}  // namespace krot::internal
