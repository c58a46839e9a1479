#pragma once

#include <Eigen/Core>

namespace krot::internal {

// Replaces a symmetric positive semidefinite matrix by a generalised inverse,
// on all threads: redundant unknowns are held at 0. Returns a basis of its null
// space, as columns; there are none if it is positive definite. A pivot counts
// as 0 if it is below 1e-12 of its own diagonal element or, once the matrix is
// known to be singular, of the largest one. So unknowns should have units in
// which diagonal elements are of similar size. O(n^3), several times as long
// for a singular matrix. The same bits at any number of threads.
Eigen::MatrixXd InvertSemidefinite(int num_threads, Eigen::MatrixXd* matrix);

}  // namespace krot::internal
