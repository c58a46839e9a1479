#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/conic/cones.h"

namespace krot::internal {

// The convex solver that some rivals of [Zhang18] call in every step, instead
// of the packages that their authors used. It solves
//
//   minimise the last of the unknowns, tau,
//   subject to s_i = G_i y + h_i in the cone K_i for all i,
//
// by a primal-dual interior point (Nesterov-Todd scaling, Mehrotra's
// predictor and corrector) on the normal equations, which `Program` stores:
//
//   using Cone, Unknowns;                     y: a fixed or dynamic vector
//   int num_cones() const;
//   Cone::Vector Slack(int i, const Unknowns& y) const;       G_i y + h_i
//   Cone::Vector Change(int i, const Unknowns& dy) const;     G_i dy
//   void AddTransposed(int i, const Cone::Vector& z, Unknowns* sum) const;
//                                                             sum += G_i'z
//   void ClearNormal();
//   void AddToNormal(int i, const NtScaling<Cone>& W);   G_i' W^-2 G_i
//   bool Factorize();
//   void Solve(Unknowns* rhs) const;
struct ConeProgramOptions {
  // Ends once tau is below this, so that it can be used as a feasibility test.
  double stop_below = -std::numeric_limits<double>::infinity();
  // Ends once the dual shows that tau cannot fall below this.
  double stop_above = std::numeric_limits<double>::infinity();
  double gap = 1e-9;  // tau minus its dual bound, absolute; > 0
  int max_iterations = 60;
  const CancelFlag* cancel = nullptr;  // may be null; read in every iteration
};

struct ConeProgramSummary {
  double tau = 0;  // attained
  // A lower bound on tau, up to the dual tolerance; -infinity until the dual is
  // feasible to that.
  double tau_bound = -std::numeric_limits<double>::infinity();
  int iterations = 0;
};

template <typename Program>
class ConeProgramSolver {
 public:
  using Cone = typename Program::Cone;
  using Vector = typename Cone::Vector;
  using Unknowns = typename Program::Unknowns;

  // Starts from *y, whose slacks must be inside their cones.
  ConeProgramSummary Minimize(Program* program,
                              const ConeProgramOptions& options, Unknowns* y) {
    program_ = program;
    ConeProgramSummary summary;
    Start(*y);
    for (;;) {
      const double gap = Gap();
      const Unknowns dual_residual = DualResidual(*y);
      summary.tau = Tau(*y);
      if (dual_residual.template lpNorm<Eigen::Infinity>() < kDualTolerance) {
        summary.tau_bound = std::max(summary.tau_bound, summary.tau - gap);
      }
      if (summary.tau < options.stop_below ||
          summary.tau_bound > options.stop_above ||
          summary.tau - summary.tau_bound < options.gap ||
          summary.iterations == options.max_iterations ||
          IsCancelled(options.cancel)) {
        break;
      }
      ++summary.iterations;
      if (!Step(gap, dual_residual, y)) break;
    }
    return summary;
  }

  // z_i of the last program.
  const std::vector<Vector>& multipliers() const { return z_; }

 private:
  static constexpr double kDualTolerance = 1e-8;
  static constexpr double kShortest = 1e-10;

  static double Tau(const Unknowns& y) { return y[y.size() - 1]; }

  int size() const { return program_->num_cones(); }

  // z_i = mu s_i^-1, with the mu for which the last row of the dual holds.
  void Start(const Unknowns& y) {
    s_.resize(size());
    z_.resize(size());
    ds_.resize(size());
    dz_.resize(size());
    scalings_.resize(size());
    Unknowns sum = Unknowns::Zero(y.size());
    for (int i = 0; i < size(); ++i) {
      s_[i] = program_->Slack(i, y);
      z_[i] = Cone::Divide(s_[i], Cone::Identity());
      program_->AddTransposed(i, z_[i], &sum);
    }
    for (int i = 0; i < size(); ++i) z_[i] /= Tau(sum);
  }

  double Gap() const {
    double gap = 0;
    for (int i = 0; i < size(); ++i) gap += s_[i].dot(z_[i]);
    return gap;
  }

  Unknowns DualResidual(const Unknowns& y) const {
    Unknowns residual = Unknowns::Zero(y.size());
    for (int i = 0; i < size(); ++i) {
      program_->AddTransposed(i, z_[i], &residual);
    }
    residual = -residual;
    residual[y.size() - 1] += 1;
    return residual;
  }

  // Solves  G'W^-2 G dy = G'W^-1 rho - dual_residual,
  //         W dz = rho - W^-1 G dy.
  void FindDirection(const std::vector<Vector>& rho,
                     const Unknowns& dual_residual, Unknowns* dy) {
    *dy = -dual_residual;
    for (int i = 0; i < size(); ++i) {
      program_->AddTransposed(i, scalings_[i].ApplyInverse(rho[i]), dy);
    }
    program_->Solve(dy);
    for (int i = 0; i < size(); ++i) {
      ds_[i] = program_->Change(i, *dy);
      dz_[i] =
          scalings_[i].ApplyInverse(rho[i] - scalings_[i].ApplyInverse(ds_[i]));
    }
  }

  void MaxSteps(double limit, double* primal, double* dual) const {
    *primal = *dual = limit;
    for (int i = 0; i < size(); ++i) {
      *primal = Cone::MaxStep(s_[i], ds_[i], *primal);
      *dual = Cone::MaxStep(z_[i], dz_[i], *dual);
    }
  }

  // One predictor and corrector; false if rounding prevents further progress.
  bool Step(double gap, const Unknowns& dual_residual, Unknowns* y) {
    program_->ClearNormal();
    rho_.resize(size());
    for (int i = 0; i < size(); ++i) {
      scalings_[i] = NtScaling<Cone>(s_[i], z_[i]);
      program_->AddToNormal(i, scalings_[i]);
      rho_[i] = -scalings_[i].Apply(z_[i]);
    }
    if (!program_->Factorize()) return false;
    Unknowns dy = Unknowns::Zero(y->size());
    FindDirection(rho_, dual_residual, &dy);
    double primal;
    double dual;
    MaxSteps(1, &primal, &dual);
    double affine_gap = 0;
    for (int i = 0; i < size(); ++i) {
      affine_gap += (s_[i] + primal * ds_[i]).dot(z_[i] + dual * dz_[i]);
    }
    const double sigma = std::pow(std::max(affine_gap / gap, 0.0), 3);
    const double target = sigma * gap / (Cone::kDegree * size());
    for (int i = 0; i < size(); ++i) {
      const Vector lambda = scalings_[i].Apply(z_[i]);
      const Vector second_order = Cone::Product(
          scalings_[i].ApplyInverse(ds_[i]), scalings_[i].Apply(dz_[i]));
      rho_[i] = Cone::Divide(lambda, target * Cone::Identity() - second_order) -
                lambda;
    }
    FindDirection(rho_, dual_residual, &dy);
    MaxSteps(1 / 0.99, &primal, &dual);
    // Both steps have the same length until the dual is feasible, as otherwise
    // tau could diverge.
    if (dual_residual.template lpNorm<Eigen::Infinity>() > kDualTolerance) {
      primal = dual = std::min(primal, dual);
    }
    primal *= 0.99;
    dual *= 0.99;
    if (!dy.allFinite() || std::max(primal, dual) < kShortest) return false;
    const Unknowns y_next = *y + primal * dy;
    for (int i = 0; i < size(); ++i) {
      const Vector s = program_->Slack(i, y_next);
      const Vector z = z_[i] + dual * dz_[i];
      if (!(Cone::SmallestEigenvalue(s) > 0 &&
            Cone::SmallestEigenvalue(z) > 0)) {
        return false;
      }
      ds_[i] = s;
      dz_[i] = z;
    }
    s_.swap(ds_);
    z_.swap(dz_);
    *y = y_next;
    return true;
  }

  Program* program_ = nullptr;
  std::vector<Vector> s_;
  std::vector<Vector> z_;
  std::vector<Vector> ds_;
  std::vector<Vector> dz_;
  std::vector<Vector> rho_;
  std::vector<NtScaling<Cone>> scalings_;
};

}  // namespace krot::internal
