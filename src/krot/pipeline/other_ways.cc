#include "krot/pipeline/other_ways.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "krot/joint/certified_solve.h"
#include "krot/pipeline/iteration_log.h"
#include "krot/pipeline/rounds.h"

namespace krot::internal {
namespace {

// A stall with a bound within so many times the gap asked for is left alone.
constexpr double kGapsOfAnswer = 10;
constexpr size_t kFewIterations = 100;

bool IsWithin(double relative_gap,
              const std::optional<PixelCertificate>& certificate, double cost) {
  return certificate && cost - certificate->lower_bound <= relative_gap * cost;
}

// None without a start.
std::optional<Estimate> OtherStart(const Start& other,
                                   const SolveModelOptions& options,
                                   const Context& context, const Timer& timer,
                                   SolveSummary* summary) {
  if (other.init == SolveInit::kModel) return other.built.start;
  return FindFeasibleStart(
             other.built.problem, options, context,
             LogIterations(options.joint.callback, timer, summary))
      .estimate;
}

template <typename Value>
void Append(const std::vector<Value>& from, std::vector<Value>* to) {
  to->insert(to->end(), from.begin(), from.end());
}

}  // namespace

void TryOtherWays(const Model& model, const SolveModelOptions& options,
                  const Context& context, const Timer& timer, Start* start,
                  Estimate* estimate,
                  std::optional<PixelCertificate>* certificate,
                  SolveSummary* summary) {
  SolveModelOptions other_options = options;
  other_options.joint.max_iterations = std::min(
      options.joint.max_iterations,
      static_cast<int>(std::max(kFewIterations, summary->iterations.size())));
  // Sweeps leave points in cameras, and with them depths that are rounding.
  const bool is_own_first =
      HasPointsInCameras(start->built.problem, start->built.start);
  for (const bool is_own : {is_own_first, !is_own_first}) {
    if (summary->termination != SolveTermination::kStalled ||
        IsWithin(kGapsOfAnswer * options.joint.relative_gap, *certificate,
                 summary->cost_final)) {
      return;
    }
    other_options.init = is_own ? SolveInit::kModel : SolveInit::kFeasible;
    context.Stage(is_own ? "that stalled; joint iterations from the model"
                         : "that stalled; from a start from nothing");
    Start other =
        is_own ? OwnStart(model, other_options, context)
               : ChooseStart(model, other_options, summary->method, context);
    if (other.built.NumPixels() != start->built.NumPixels()) continue;
    SolveSummary way;
    way.method = summary->method;
    way.norm = summary->norm;
    std::optional<Estimate> found =
        OtherStart(other, other_options, context, timer, &way);
    if (found) {
      std::optional<PixelCertificate> proof = SolveInRounds(
          model, other_options, is_own ? SolveMethod::kJoint : summary->method,
          context, timer, &other.built, &*found, &way);
      if (way.cost_final < summary->cost_final) {
        *start = std::move(other);
        summary->init = start->init;
        *estimate = *std::move(found);
        summary->cost_final = way.cost_final;
      }
      if (proof &&
          (!*certificate || proof->lower_bound > (*certificate)->lower_bound)) {
        *certificate = std::move(proof);
      }
      if (IsWithin(options.joint.relative_gap, *certificate,
                   summary->cost_final)) {
        summary->termination = SolveTermination::kGapReached;
      }
    }
    if (context.IsCancelled()) {
      summary->termination = SolveTermination::kInterrupted;
    }
    Append(way.rounds, &summary->rounds);
    Append(way.sweeps, &summary->sweeps);
    Append(way.iterations, &summary->iterations);
  }
}

}  // namespace krot::internal
