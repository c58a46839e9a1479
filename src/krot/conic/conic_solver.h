#pragma once

#include <vector>

#include "krot/conic/cone_program.h"
#include "krot/conic/cones.h"
#include "krot/conic/interior_point.h"
#include "krot/conic/nt_scaling.h"
#include "krot/conic/point_elimination.h"

namespace krot {

// One run of the interior point. With s_i = T (top_i; v_i) in the cone, z_i
// its multiplier and W_i their scaling, a direction (dx, dg) minimises
//
//   1/2 sum_i | W_i^-1 ds_i - f_i |^2 + dg,   ds_i = (A dx + b dg)_i,
//
// a linear least squares problem, along the gauge e'dx = 0; f_i = 0 is the
// predictor, and f_i with lambda_i o f_i = sigma mu e - (W^-1 ds o W dz) the
// corrector [Mehrotra 1992]. The multipliers follow: W dz = f - lambda -
// W^-1 ds.
//
// For the cost programme, top = g w is bilinear. Slacks are recomputed at
// every trial; the bilinear term of the Newton system is left out, so that the
// system is that of a Dinkelbach step based at the iterate, and convex.
template <typename Cone>
class ConicSolver {
 public:
  ConicSolver(const KnownRotationProblem& problem,
              const InteriorPointOptions& options, const ConeProgram& program,
              const Estimate& start, double scalar);

  InteriorPointSummary Run();

  const Estimate& best() const { return best_; }
  std::vector<Multiplier> TakeMultipliers() { return std::move(multipliers_); }

  static int64_t MemoryBytes(const KnownRotationProblem& problem);

 private:
  static constexpr int kDim = Cone::kDim;
  using Vector = typename Cone::Vector;

  // A point on the path.
  struct State {
    Estimate x;
    double scalar = 0;  // g: gamma or tau
    std::vector<ViewedPoint> viewed;
    std::vector<Vector> z;
    double gap = 0;  // sum s'z
    double cost = 0;
  };

  template <typename Body>
  void ForObservations(const Body& body) const;
  template <typename Term>
  double Sum(const Term& term) const;
  template <typename Term>
  double Min(const Term& term) const;

  Vector Slack(const ViewedPoint& viewed, double scalar) const;
  void ViewAll(State* state) const;
  void CentreMultipliers();
  void Linearize();
  void FillRows(int64_t i, const Eigen::Matrix3d& K, double* rows) const;
  BlockVector GaugeRow() const;
  void SolveBorder();
  void SolveDirection(double sigma);
  double AffineSigma() const;
  double MaxStep() const;
  double TakeStep();
  bool IsInside(const State& trial, double largest_step) const;
  void ExportMultipliers();

  const KnownRotationProblem& problem_;
  const InteriorPointOptions& options_;
  const ConeProgram program_;
  const int64_t n_;  // observations
  const bool has_free_scale_;
  const BlockStructure structure_;
  Eigen::Matrix<double, kDim, 3> T_;  // (top; v) into the cone
  PointElimination<kDim> elimination_;

  State now_;
  State trial_;
  Estimate best_;
  double best_cost_ = 0;
  std::vector<Multiplier> multipliers_;

  // At the iterate, all scaled by W.
  double mu_ = 0;
  std::vector<NtScaling<Cone>> scaling_;
  std::vector<Vector> lambda_;
  std::vector<Vector> border_;   // b: the column of g
  std::vector<Vector> target_;   // f
  std::vector<Vector> ds_, dz_;  // the direction
  std::vector<Vector> rest_;     // b - A Xb
  BlockVector gauge_;            // e
  BlockVector x_border_;         // Xb = H^-1 A'b
  BlockVector x_gauge_;          // Xe = H^-1 e
  BlockVector x_target_;
  BlockVector dx_;
  double dscalar_ = 0;
  double last_max_step_ = 0;
};

}  // namespace krot
