#include "krot/outliers/error_profile.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/base/check.h"
#include "krot/outliers/optimum_without.h"
#include "krot/outliers/packing.h"

namespace krot {
namespace {

// Few are enough where the last level's weights are at hand.
constexpr int kFirstProgrammes = 4;
constexpr int kNextProgrammes = 2;

class Profiler {
 public:
  Profiler(const Model& model, const BuiltProblem& built,
           const ErrorProfileOptions& options, const Context& context)
      : model_(model),
        built_(built),
        options_(options),
        context_(context),
        search_(model, built, options.norm, context) {}

  ErrorProfile Run();

 private:
  ProfileLevel Solve(Removal removal) const;
  void Charge(ProfileLevel* level);
  void Append(ProfileLevel level);

  const Model& model_;
  const BuiltProblem& built_;
  const ErrorProfileOptions& options_;
  const Context& context_;
  RemovalSearch search_;
  ErrorProfile profile_;
};

// The optimum of what a removal leaves.
ProfileLevel Profiler::Solve(Removal removal) const {
  OptimumWithout optimum =
      SolveWithout(model_, built_, removal.observations, removal.estimate,
                   options_.norm, options_.relative_gap, context_);
  ProfileLevel level;
  level.removal = std::move(removal);
  level.removal.estimate = std::move(optimum.estimate);
  level.max_error = optimum.max_error;
  level.lower_bound = optimum.lower_bound;
  level.proof = std::move(optimum.proof);
  return level;
}

void Profiler::Charge(ProfileLevel* level) {
  if (level->removal.observations.size() <= options_.max_charged) {
    profile_.conflicts =
        PackAgainstRemoval(model_, built_, {options_.norm, level->max_error},
                           level->removal, std::move(profile_.conflicts),
                           context_)
            .conflicts;
  }
  level->num_proved = static_cast<int64_t>(profile_.conflicts.size());
}

// In the place of those that removed no less.
void Profiler::Append(ProfileLevel level) {
  std::vector<ProfileLevel>& levels = profile_.levels;
  while (levels.size() > 1 && levels.back().removal.observations.size() >=
                                  level.removal.observations.size()) {
    levels.pop_back();
  }
  levels.push_back(std::move(level));
}

std::optional<size_t> Elbow(const std::vector<ProfileLevel>& levels) {
  if (levels.size() < 3) return std::nullopt;
  const auto removed = [&](size_t n) {
    return static_cast<double>(levels[n].removal.observations.size());
  };
  const size_t last = levels.size() - 1;
  const auto fall = [&](size_t n) {
    return std::log(levels[0].max_error / levels[n].max_error);
  };
  std::optional<size_t> elbow;
  double largest = 0;
  for (size_t n = 1; n < last; ++n) {
    const double below = fall(n) / fall(last) - removed(n) / removed(last);
    if (!(below > largest)) continue;
    largest = below;
    elbow = n;
  }
  return elbow;
}

ErrorProfile Profiler::Run() {
  Removal nothing;
  nothing.estimate = built_.start;
  profile_.levels.push_back(Solve(std::move(nothing)));
  const double first = profile_.levels[0].max_error;
  const double last = options_.max_error.value_or(first / 2);
  for (int n = 0; !context_.IsCancelled(); ++n) {
    const double now = profile_.levels.back().max_error;
    if (!(now > last) || !std::isfinite(now)) break;
    const double steps = std::max(1, options_.num_levels - n);
    const double bound = std::max(last, now * std::pow(last / now, 1 / steps));
    ProfileLevel level =
        Solve(search_.Find(bound, n == 0 ? kFirstProgrammes : kNextProgrammes));
    if (context_.IsCancelled() || !(level.max_error < now)) break;
    Charge(&level);
    Append(std::move(level));
  }
  profile_.elbow = Elbow(profile_.levels);
  return std::move(profile_);
}

}  // namespace

ErrorProfile FindErrorProfile(const Model& model, const BuiltProblem& built,
                              const ErrorProfileOptions& options,
                              const Context& context) {
  CheckArgument(!options.max_error || *options.max_error > 0, "max_error",
                options.max_error.value_or(0), "> 0");
  CheckArgument(options.relative_gap > 0, "relative_gap", options.relative_gap,
                "> 0");
  CheckArgument(options.num_levels >= 1, "num_levels", options.num_levels,
                ">= 1");
  return Profiler(model, built, options, context).Run();
}

}  // namespace krot
