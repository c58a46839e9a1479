#pragma once

#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Core>

#include "krot/verify/certificate_check.h"
#include "tests/oracle/dense_algebra.h"

namespace krot::internal {

// What a stranger's pocket script finds, for a connected support without
// baselines: everything dense, in long double, rows and unknowns in a map, the
// smallest singular value by an SVD. y and lambda both may change, in units of
// lambda. No code is shared with the library.
struct NaiveCheck {
  double longest = 0;  // max |y_i|_dual / lambda_i
  double term = 0;     // |defect|_2 / sigma_min(M)
};

inline NaiveCheck CheckNaively(const KnownRotationProblem& problem, double p,
                               const Certificate& certificate) {
  std::map<int, int> point_row, frame_row;
  int rows = 0;
  int omitted = -1;
  for (const CertifiedObservation& certified : certificate.observations) {
    const Observation& o = problem.observations[certified.observation];
    const int frame = problem.views[o.view].frame;
    if (point_row.emplace(o.point, rows).second) rows += 3;
    if (omitted < 0) omitted = frame;
    if (frame != omitted && frame_row.emplace(frame, rows).second) rows += 3;
  }
  const int count = static_cast<int>(certificate.observations.size());
  LongMatrix M = LongMatrix::Zero(rows, 3 * count);
  LongVector defect = LongVector::Zero(rows);
  NaiveCheck check;
  for (int i = 0; i < count; ++i) {
    const CertifiedObservation& certified = certificate.observations[i];
    const Observation& o = problem.observations[certified.observation];
    const View& view = problem.views[o.view];
    const long double lambda = certified.lambda;
    const auto add = [&](int row, const Eigen::Matrix3d& R) {
      const auto entry = [&](int r, int k) {  // of E R
        long double sum = 0;
        for (int n = 0; n < 3; ++n) {
          sum += static_cast<long double>(o.E(r, n)) * R(n, k);
        }
        return sum;
      };
      for (int k = 0; k < 3; ++k) {
        for (int r = 0; r < 2; ++r) {
          const long double a = entry(1 + r, k);
          M(row + k, 3 * i + r) = lambda * a;
          defect(row + k) += a * certified.y[r];
        }
        M(row + k, 3 * i + 2) = certificate.lower_bound * lambda * entry(0, k);
        defect(row + k) += M(row + k, 3 * i + 2);
      }
    };
    add(point_row.at(o.point), view.cam_from_world_rotation);
    if (view.frame != omitted) {
      add(frame_row.at(view.frame), view.cam_from_rig_rotation);
    }
    const double a = std::abs(certified.y[0]);
    const double b = std::abs(certified.y[1]);
    const double dual = p == 1   ? std::max(a, b)
                        : p == 2 ? std::hypot(a, b)
                                 : a + b;
    check.longest = std::max(check.longest, dual / certified.lambda);
  }
  check.term =
      rows > 3 * count
          ? INFINITY
          : static_cast<double>(defect.norm() / SingularValues(M)(rows - 1));
  return check;
}

}  // namespace krot::internal
