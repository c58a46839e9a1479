#pragma once

#include <Eigen/Core>

namespace krot::internal {

// A generalised inverse of a symmetric positive semidefinite matrix, in its
// place, on all threads: unknowns that the others determine are held at 0.
// Returns, as columns, the motions that the matrix does not see; there are none
// where it is positive definite. A pivot below 1e-12 of its diagonal counts as
// 0: give unknowns units in which the diagonal tells rounding. O(n^3), with a
// defect several times as long. The same bits at any number of threads.
Eigen::MatrixXd InvertSemidefinite(int num_threads, Eigen::MatrixXd* matrix);

}  // namespace krot::internal
