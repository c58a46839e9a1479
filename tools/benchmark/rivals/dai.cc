#include "tools/benchmark/rivals/dai.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace krot::internal {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;

constexpr int kMaxIterations = 200;
constexpr double kShortestStep = 1e-6;

class Dai : public SubproblemSolver {
 public:
  std::string Name() const override { return "Dai"; }

  Vector3d Minimize(const Subproblem& problem) override {
    Vector3d x = problem.start;
    Vector3d best = x;
    double gamma = problem.Cost(x, Norm::L2());
    const double count = static_cast<double>(problem.residuals.size());
    lambda_.assign(problem.residuals.size(), 1 / count);
    double mu = 0.1 * gamma / count;
    for (int iteration = 0; iteration < kMaxIterations && gamma > 0;
         ++iteration) {
      Linearize(problem, x, gamma);
      const double t = Relaxation(mu);
      const bool is_stationary = Stationarity() <= kRivalTolerance * gamma;
      if (is_stationary && count * mu <= kRivalTolerance * gamma) break;
      const Vector3d direction = Step(t, mu);
      const double step = StepSize(problem, x, direction, gamma + t);
      x += step * direction;
      const double cost = problem.Cost(x, Norm::L2());
      if (cost < gamma) {
        gamma = cost;
        best = x;
      }
      if (is_stationary || step > 0.5) mu *= 0.2;
    }
    return best;
  }

 private:
  struct Constraint {
    double value;  // f_i
    Vector3d gradient;
    Vector3d bend;  // the Hessian is bend bend'
  };

  void Linearize(const Subproblem& problem, const Vector3d& x, double gamma) {
    constraints_.clear();
    for (const Residual& residual : problem.residuals) {
      const Vector2d v = residual.Numerator(x);
      const double w = residual.Depth(x);
      const double n = std::max(v.norm(), 1e-12);
      Constraint constraint;
      constraint.value = (n - gamma * w) / w;
      constraint.gradient =
          (residual.A.transpose() * v / n - gamma * residual.c) / w;
      constraint.bend = residual.A.transpose() * Vector2d(-v[1], v[0]) /
                        (n * std::sqrt(n * w));
      constraints_.push_back(constraint);
    }
  }

  // The t for which the sum of all lambda_i (t - f_i) is that of the centre,
  // mu times the number of constraints.
  double Relaxation(double mu) const {
    double t = static_cast<double>(constraints_.size()) * mu;
    double largest = 0;
    for (size_t i = 0; i < constraints_.size(); ++i) {
      t += lambda_[i] * constraints_[i].value;
      largest = std::max(largest, constraints_[i].value);
    }
    return std::max(t, largest + mu);
  }

  double Stationarity() const {
    Vector3d sum = Vector3d::Zero();
    for (size_t i = 0; i < constraints_.size(); ++i) {
      sum += lambda_[i] * constraints_[i].gradient;
    }
    return sum.norm();
  }

  // The Newton step of (x, t) and lambda towards the centre. Returns the step
  // of x, and takes that of lambda as far as all stay positive.
  Vector3d Step(double t, double mu) {
    Eigen::Matrix4d M = Eigen::Matrix4d::Zero();
    Vector4d rhs(0, 0, 0, -1);
    for (size_t i = 0; i < constraints_.size(); ++i) {
      const Constraint& f = constraints_[i];
      const double slack = t - f.value;
      Vector4d a;
      a << f.gradient, -1;
      M.topLeftCorner<3, 3>() += lambda_[i] * f.bend * f.bend.transpose();
      M += lambda_[i] / slack * a * a.transpose();
      rhs -= mu / slack * a;
    }
    const Vector4d step = M.ldlt().solve(rhs);
    double sum = 0;
    for (size_t i = 0; i < constraints_.size(); ++i) {
      const Constraint& f = constraints_[i];
      const double change = step[3] - f.gradient.dot(step.head<3>());
      const double target = (mu - lambda_[i] * change) / (t - f.value);
      lambda_[i] = std::max(target, 0.01 * lambda_[i]);
      sum += lambda_[i];
    }
    for (double& lambda : lambda_) lambda /= sum;
    return step.head<3>();
  }

  // The first of 1, 1/2, 1/4 ... with a cost below `limit`, which is inside the
  // relaxed region; 0 if there is none.
  static double StepSize(const Subproblem& problem, const Vector3d& x,
                         const Vector3d& direction, double limit) {
    for (double step = 1; step > kShortestStep; step /= 2) {
      if (problem.Cost(x + step * direction, Norm::L2()) < limit) return step;
    }
    return 0;
  }

  std::vector<Constraint> constraints_;
  std::vector<double> lambda_;
};

}  // namespace

std::unique_ptr<SubproblemSolver> MakeDai() { return std::make_unique<Dai>(); }

}  // namespace krot::internal
