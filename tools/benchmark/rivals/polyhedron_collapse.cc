#include "tools/benchmark/rivals/polyhedron_collapse.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/math/simplex_qp.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr int kMaxIterations = 1000;
constexpr double kWidestActive = 1e-2;  // relative to the cost
constexpr double kNarrowestActive = 1e-10;

// A face s'v = gamma w: the piece n'x + a over c'x + d.
struct Face {
  Vector3d n;
  double a;
  Vector3d c;
  double d;
};

// A piece along a line: (p + q alpha) / (w + z alpha), monotonic.
struct LinePiece {
  double p;
  double q;
  double w;
  double z;

  double Slope() const { return q * w - p * z; }  // has the slope's sign
};

// The smallest alpha above `from` where `b` becomes larger than `a`.
double Overtaking(const LinePiece& a, const LinePiece& b, double from) {
  // (b.p + b.q t)(a.w + a.z t) - (a.p + a.q t)(b.w + b.z t) turns positive.
  const double c0 = b.p * a.w - a.p * b.w;
  const double c1 = b.q * a.w + b.p * a.z - a.q * b.w - a.p * b.z;
  const double c2 = b.q * a.z - a.q * b.z;
  double first = std::numeric_limits<double>::infinity();
  const double discriminant = c1 * c1 - 4 * c2 * c0;
  if (discriminant < 0) return first;
  const double q = -(c1 + std::copysign(std::sqrt(discriminant), c1)) / 2;
  for (const double root : {q / c2, c0 / q}) {
    const bool turns_positive = c1 + 2 * c2 * root > 0;
    if (root > from && turns_positive) first = std::min(first, root);
  }
  return first;
}

class PolyhedronCollapse : public SubproblemSolver {
 public:
  std::string Name() const override { return "collapse"; }

  Vector3d Minimize(const Subproblem& problem) override {
    ListFaces(problem);
    Vector3d x = problem.start;
    double cost = problem.Cost(x, Norm::LInf());
    double active = kWidestActive;
    for (int iteration = 0; iteration < kMaxIterations && cost > 0;
         ++iteration) {
      const Vector3d direction = Inwards(x, cost, active);
      const double step = FindStep(x, direction);
      const Vector3d x_next = x + step * direction;
      const double cost_next = problem.Cost(x_next, Norm::LInf());
      const bool gains = cost_next < (1 - 0.1 * active) * cost;
      if (cost_next < cost) {
        x = x_next;
        cost = cost_next;
      }
      if (gains) continue;
      active *= 0.1;  // some of these faces are too far away
      if (active < kNarrowestActive) break;
    }
    return x;
  }

 private:
  void ListFaces(const Subproblem& problem) {
    faces_.clear();
    for (const Residual& residual : problem.residuals) {
      for (int k = 0; k < 2; ++k) {
        for (const double sign : {1.0, -1.0}) {
          faces_.push_back({sign * residual.A.row(k).transpose(),
                            sign * residual.b[k], residual.c, residual.d});
        }
      }
    }
  }

  // Minus the point of least norm of the convex hull of the active gradients:
  // along this direction the pieces with a weight in that point fall at equal
  // rates.
  Vector3d Inwards(const Vector3d& x, double cost, double active) {
    gradients_.clear();
    for (const Face& face : faces_) {
      const double w = face.c.dot(x) + face.d;
      const double value = (face.n.dot(x) + face.a) / w;
      if (value >= (1 - active) * cost) {
        gradients_.push_back((face.n - value * face.c) / w);
      }
    }
    return -MinNormPoint(gradients_.data(), static_cast<int>(gradients_.size()),
                         &scratch_);
  }

  // Follows the largest piece along the line, from piece to piece, until the
  // largest one rises.
  double FindStep(const Vector3d& x, const Vector3d& direction) {
    line_.clear();
    for (const Face& face : faces_) {
      line_.push_back({face.n.dot(x) + face.a, face.n.dot(direction),
                       face.c.dot(x) + face.d, face.c.dot(direction)});
    }
    size_t largest = 0;
    for (size_t k = 1; k < line_.size(); ++k) {
      const double difference =
          line_[k].p * line_[largest].w - line_[largest].p * line_[k].w;
      if (difference > 0) largest = k;
    }
    double step = 0;
    for (size_t changes = 0; changes < line_.size(); ++changes) {
      if (line_[largest].Slope() >= 0) break;
      double next = std::numeric_limits<double>::infinity();
      size_t overtaker = largest;
      for (size_t k = 0; k < line_.size(); ++k) {
        if (k == largest) continue;
        const double at = Overtaking(line_[largest], line_[k], step);
        if (at < next) {
          next = at;
          overtaker = k;
        }
      }
      if (overtaker == largest) break;
      step = next;
      largest = overtaker;
    }
    return step;
  }

  std::vector<Face> faces_;
  std::vector<LinePiece> line_;
  std::vector<Vector3d> gradients_;
  std::vector<LinearPiece> scratch_;
};

}  // namespace

std::unique_ptr<SubproblemSolver> MakePolyhedronCollapse() {
  return std::make_unique<PolyhedronCollapse>();
}

}  // namespace krot::internal
