#include "krot/conic/interior_point.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/base/check.h"
#include "krot/conic/cones.h"
#include "krot/conic/newton_system.h"
#include "krot/conic/path_following.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {
namespace {

// One run of the interior point. Slacks are recomputed at every trial, as top =
// g w is bilinear. In the other programmes top is linear, and slacks and
// multipliers have their own step lengths.
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

  // What FollowPath calls.
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

  // Starts with z = s^-1 times a factor, perfectly centred. With this factor
  // the row of g holds, which is sum lambda w = 1 in the cost programme; in the
  // linear programme the multipliers are soon stationary. Known multipliers, if
  // given, are mixed in.
  void FindStartMultipliers() {
    system_.loop().ForEach([&](int64_t i) {
      now_.z[i] = Cone::Divide(system_.Slack(now_, i), Cone::Identity());
    });
    if (program_.IsLinear()) {
      if (!system_.Factorize(now_)) return;
      const double mu = 2 * system_.ObjectiveLength();
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
  // Replaces the centred multipliers by the known ones, except for a small
  // share. That is far from the central path, but near to its end. The share is
  // proportional to the start margin, so that gamma and the multipliers are
  // about equally far from the end.
  void JoinKnownMultipliers(const std::vector<Multiplier>& known) {
    const double share = std::min(100. / 3 * options_.start_margin, 0.3);
    const double sum = system_.loop().Sum(
        [&](int64_t i) { return known[i].lambda * now_.viewed[i].depth; });
    if (!(sum > 0)) return;
    system_.loop().ForEach([&](int64_t i) {
      const Vector of_known = FromMultiplier<Cone::kDim>(
          options_.norm, known[i].lambda, known[i].y);
      now_.z[i] = share * now_.z[i] + (1 - share) / sum * of_known;
    });
  }

  // Factorises at the iterate of a linear programme, and makes the multipliers
  // stationary by the least change in the scaling, if that stays well inside
  // the cones. A second change removes what rounding left.
  bool FactorizeStationary() {
    constexpr double kSmallChange = 1e3;  // room for which the factor is kept
    if (!system_.Factorize(now_)) return false;
    for (int change = 0; change < 2; ++change) {
      system_.SolveForStationarity(now_.z);
      const double room = system_.loop().Min([&](int64_t i) {
        return Cone::MaxStep(system_.lambda()[i], system_.direction().dz[i],
                             kSmallChange);
      });
      const bool is_inside = room >= 1.25;
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

  // The gap relative to gamma or, in the linear programme, to the distance in
  // h'x between the start and the bound that the multipliers prove.
  double RelativeGap() const {
    if (!program_.IsLinear()) return now_.gap / now_.scalar;
    return now_.gap / std::max(now_.gap, start_ - now_.scalar + now_.gap);
  }

  const InteriorPointOptions options_;
  const Context context_;
  const ConeProgram program_;
  bool is_factorized_ = false;  // system_, at now_
  // Linear programme: whether the dual residual vanishes up to rounding. Until
  // then steps only centre, which keeps the multipliers large enough to be
  // changed.
  bool is_stationary_ = false;
  const double start_;  // g at the start
  Estimate best_;
  double best_reached_ = 0;  // the lowest cost or, in a linear programme, h'x
  std::vector<Multiplier> multipliers_;
  InteriorPointSummary summary_;
};

InteriorPointSummary Run(const KnownRotationProblem& problem,
                         const InteriorPointOptions& options,
                         const Context& context, const ConeProgram& program,
                         const Estimate& start, double scalar,
                         Estimate* estimate,
                         std::vector<Multiplier>* multipliers) {
  CheckConic(options.norm);
  CheckAtLeast(1, options.max_iterations, "max_iterations");
  CheckPositive(options.smallest_gap, "smallest_gap");
  const auto run = [&](auto cone) {
    ConicSolver<decltype(cone)> solver(problem, options, context, program,
                                       start, scalar);
    const InteriorPointSummary summary = solver.Run();
    if (program.kind != ConeProgram::Kind::kFeasibility ||
        summary.termination == InteriorPointTermination::kFeasible) {
      *estimate = solver.best();
    }
    *multipliers = solver.TakeMultipliers();
    return summary;
  };
  return options.norm.p == 2 ? run(SecondOrderCone()) : run(FourHalfLines());
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
  // The smallest tau with which everything at the origin is in all cones, to
  // which a margin of 1 is added. Depths and v at the origin vanish unless
  // there are baselines or fixed positions.
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
