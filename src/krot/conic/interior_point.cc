#include "krot/conic/interior_point.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/base/check.h"
#include "krot/conic/newton_system.h"
#include "krot/conic/path_following.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {
namespace {

// Linear programme: mu at the start, beside ObjectiveLength; how much longer a
// change that makes the multipliers stationary could be, and one that is small.
constexpr double kMuPerLength = 2;
constexpr double kStationaryRoom = 1.25;
constexpr double kSmallChange = 1e3;
// Known multipliers: a start begins with the centred ones by this share for
// each margin that it has, and by the second at most.
constexpr double kCentredPerMargin = 100. / 3;
constexpr double kLargestCentredShare = 0.3;

// One run of the interior point. Slacks are recomputed at every trial: top = g
// w is bilinear. Where it is linear, in the feasibility programme, slacks and
// multipliers have step lengths of their own.
template <typename Cone>
class ConicSolver : public ConePath<NewtonSystem<Cone>> {
 public:
  ConicSolver(const KnownRotationProblem& problem,
              const InteriorPointOptions& options, const Context& context,
              const ConeProgram& program, const Estimate& start, double scalar)
      : Base(problem, program, options.norm, context.num_threads),
        options_(options),
        context_(context),
        program_(program),
        start_(scalar),
        best_(start),
        multipliers_(problem.observations.size()) {
    now_.x = start;
    now_.scalar = scalar;
    now_.z.resize(problem.observations.size());
    system_.ViewAll(&now_);
    trial_ = now_;
    FindStartMultipliers();
    best_reached_ = program.IsLinear() ? scalar : Cost(now_.viewed);
  }

  InteriorPointSummary Run() {
    summary_.termination = FollowPath(context_, options_.max_iterations, this,
                                      &summary_.iterations);
    return summary_;
  }

  // FollowPath's.
  bool Factorize() {
    return std::exchange(is_factorized_, false) || system_.Factorize(now_);
  }
  bool IsThere() const { return false; }
  void FindDirection(double step) {
    if (program_.IsLinear() && !is_stationary_) {
      Base::Centre(1);
    } else if (step < kShortStep) {
      Base::Centre(Base::kCentring);
    } else {
      Base::PredictAndCorrect();
    }
  }

  std::optional<InteriorPointTermination> Report(int iteration, double step) {
    using Termination = InteriorPointTermination;
    if (program_.IsLinear()) {
      if (!FactorizeStationary()) return Termination::kSingular;
      is_factorized_ = true;
    }
    system_.loop().ForEach([&](int64_t i) {
      const Eigen::Vector3d z = system_.ToMultiplier(now_.z[i]);
      multipliers_[i] = {z[0], z.tail<2>()};
    });
    summary_.gamma = now_.scalar;
    summary_.gap = RelativeGap();
    const double cost = Cost(now_.viewed);
    const double reached = program_.IsLinear() ? now_.scalar : cost;
    if (reached < best_reached_) {
      best_reached_ = reached;
      best_ = now_.x;
    }
    const ConicIterate iterate{iteration,    now_.scalar, cost,
                               summary_.gap, step,        &now_.x,
                               &multipliers_};
    if (options_.stop && options_.stop(iterate)) return Termination::kStopped;
    if (program_.kind == ConeProgram::Kind::kFeasibility &&
        cost < program_.bound) {
      best_ = now_.x;
      return Termination::kFeasible;
    }
    if (summary_.gap <= options_.smallest_gap) return Termination::kConverged;
    return std::nullopt;
  }

  const Estimate& best() const { return best_; }
  std::vector<Multiplier> TakeMultipliers() { return std::move(multipliers_); }

 private:
  using Base = ConePath<NewtonSystem<Cone>>;
  using Vector = typename Cone::Vector;
  using Base::now_;
  using Base::system_;
  using Base::trial_;

  // z = s^-1, perfectly centred: scaled so that the row of g holds, which is
  // sum lambda w = 1 in the cost programme; likewise near known ones; or, in
  // the linear programme, so that from the middle of the cones they are soon
  // stationary.
  void FindStartMultipliers() {
    system_.loop().ForEach([&](int64_t i) {
      now_.z[i] = Cone::Divide(system_.Slack(now_, i), Cone::Identity());
    });
    if (program_.IsLinear()) {
      if (!system_.Factorize(now_)) return;
      const double mu = kMuPerLength * system_.ObjectiveLength();
      system_.loop().ForEach([&](int64_t i) { now_.z[i] *= mu; });
      return;
    }
    const double sum = system_.loop().Sum([&](int64_t i) {
      return system_.ToMultiplier(now_.z[i])[0] *
             program_.TopPerScalar(now_.viewed[i].depth);
    });
    system_.loop().ForEach([&](int64_t i) { now_.z[i] /= sum; });
    if (options_.known_multipliers != nullptr && program_.IsCost()) {
      JoinKnownMultipliers(*options_.known_multipliers);
    }
  }
  // All but a small share of the centred ones give way to the known ones: far
  // from the path, but near to where it ends. The share goes with the margin
  // that the start has, so that both are as far from there.
  void JoinKnownMultipliers(const std::vector<Multiplier>& known) {
    const double share = std::min(kCentredPerMargin * options_.start_margin,
                                  kLargestCentredShare);
    const double sum = system_.loop().Sum(
        [&](int64_t i) { return known[i].lambda * now_.viewed[i].depth; });
    if (!(sum > 0)) return;
    system_.loop().ForEach([&](int64_t i) {
      const Vector of_known = FromMultiplier<Cone::kDim>(
          options_.norm, known[i].lambda, known[i].y);
      now_.z[i] = share * now_.z[i] + (1 - share) / sum * of_known;
    });
  }

  // Factorises at the iterate. The linear programme's multipliers take the
  // least change, in the scaling, that makes them stationary, if that stays
  // well inside of the cones; the second change is for what rounding left.
  bool FactorizeStationary() {
    if (!system_.Factorize(now_)) return false;
    for (int change = 0; change < 2; ++change) {
      system_.SolveForStationarity(now_.z);
      const double room = system_.loop().Min([&](int64_t i) {
        return Cone::MaxStep(system_.lambda()[i], system_.direction().dz[i],
                             kSmallChange);
      });
      const bool is_inside = room >= kStationaryRoom;
      if (change == 0) is_stationary_ = is_inside;
      if (!is_inside) return true;
      system_.loop().ForEach(
          [&](int64_t i) { now_.z[i] += system_.UnscaledDz(i); });
      if (room < kSmallChange && !system_.Factorize(now_)) return false;
    }
    return true;
  }

  double Cost(const std::vector<ViewedPoint>& viewed) const {
    return -system_.loop().Min(
        [&](int64_t i) { return -ResidualOf(viewed[i], options_.norm); });
  }

  // The linear programme's is relative to the way from the start to the dual's.
  double RelativeGap() const {
    if (!program_.IsLinear()) return now_.gap / now_.scalar;
    return now_.gap / std::max(now_.gap, start_ - now_.scalar + now_.gap);
  }

  const InteriorPointOptions options_;
  const Context context_;
  const ConeProgram program_;
  bool is_factorized_ = false;  // system_, at now_
  // Linear programme: the dual residual vanishes up to rounding. Until then
  // steps only centre: where nothing is active it would be missed by as much
  // as there is.
  bool is_stationary_ = false;
  const double start_;  // g there
  Estimate best_;
  double best_reached_ = 0;  // the lowest cost or, in a linear programme, h'x
  std::vector<Multiplier> multipliers_;
  InteriorPointSummary summary_;
};

template <typename Cone>
InteriorPointSummary RunInCone(
    const KnownRotationProblem& problem, const InteriorPointOptions& options,
    const Context& context, const ConeProgram& program, const Estimate& start,
    double scalar, Estimate* estimate, std::vector<Multiplier>* multipliers) {
  ConicSolver<Cone> solver(problem, options, context, program, start, scalar);
  const InteriorPointSummary summary = solver.Run();
  if (program.kind != ConeProgram::Kind::kFeasibility ||
      summary.termination == InteriorPointTermination::kFeasible) {
    *estimate = solver.best();
  }
  *multipliers = solver.TakeMultipliers();
  return summary;
}

InteriorPointSummary Run(const KnownRotationProblem& problem,
                         const InteriorPointOptions& options,
                         const Context& context, const ConeProgram& program,
                         const Estimate& start, double scalar,
                         Estimate* estimate,
                         std::vector<Multiplier>* multipliers) {
  CheckConic(options.norm);
  CheckAtLeast(1, options.max_iterations, "max_iterations");
  CheckPositive(options.smallest_gap, "smallest_gap");
  const auto run = options.norm.p == 2 ? &RunInCone<SecondOrderCone>
                                       : &RunInCone<FourHalfLines>;
  return run(problem, options, context, program, start, scalar, estimate,
             multipliers);
}

}  // namespace

InteriorPointSummary MinimizeJointly(const KnownRotationProblem& problem,
                                     const InteriorPointOptions& options,
                                     const Context& context, Estimate* estimate,
                                     std::vector<Multiplier>* multipliers) {
  CheckPositive(options.start_margin, "start_margin");
  const double cost =
      Cost(problem, *estimate, options.norm, context.num_threads);
  CheckArgument(std::isfinite(cost), "cost of the start", cost,
                "finite: all depths positive");
  if (options.known_multipliers != nullptr) {
    const size_t count = options.known_multipliers->size();
    CheckArgument(count == problem.observations.size(),
                  "number of known multipliers", count,
                  "that of the observations");
  }
  if (!(cost > 0)) {  // already at the lowest possible
    multipliers->assign(problem.observations.size(), {});
    InteriorPointSummary summary;
    summary.termination = InteriorPointTermination::kConverged;
    return summary;
  }
  return Run(problem, options, context, ConeProgram{}, *estimate,
             (1 + options.start_margin) * cost, estimate, multipliers);
}

InteriorPointSummary FindFeasible(const KnownRotationProblem& problem,
                                  const InteriorPointOptions& options,
                                  const Context& context, double bound,
                                  double unit_depth, Estimate* estimate,
                                  std::vector<Multiplier>* multipliers) {
  CheckPositive(bound, "bound");
  CheckPositive(unit_depth, "unit_depth");
  const ConeProgram program = {ConeProgram::Kind::kFeasibility, bound,
                               unit_depth};
  const Estimate origin = AllAtOrigin(problem);
  // The least tau that leaves every cone at the origin, and a margin: the
  // origin's depths and v vanish but for the baselines.
  double scalar = 1;
  for (const Observation& observation : problem.observations) {
    const ViewedPoint viewed = ViewPoint(problem, observation, origin);
    scalar = std::max(
        scalar, 1 + (NormOf(viewed.v, options.norm) / bound - viewed.depth) /
                        unit_depth);
  }
  return Run(problem, options, context, program, origin, scalar + 1, estimate,
             multipliers);
}

InteriorPointSummary MinimizeLinear(const KnownRotationProblem& problem,
                                    const InteriorPointOptions& options,
                                    const Context& context, double bound,
                                    const LinearObjective& objective,
                                    Estimate* estimate,
                                    std::vector<Multiplier>* multipliers) {
  const double cost =
      Cost(problem, *estimate, options.norm, context.num_threads);
  CheckArgument(cost < bound, "cost of the start", cost, "below the bound");
  const ConeProgram program = {ConeProgram::Kind::kLinear, bound, 0,
                               &objective};
  const std::vector<Eigen::Vector3d> centres =
      CentresOf(RigFromWorldRotations(problem), estimate->translations);
  return Run(problem, options, context, program, *estimate,
             objective.h.Dot({estimate->points, centres}), estimate,
             multipliers);
}

}  // namespace krot::internal
