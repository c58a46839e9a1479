#include "krot/proof/block_angular_qr.h"

#include <limits>
#include <utility>

namespace krot {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Whether each column leaves more than rounding beside those before it.
bool AreIndependent(const Eigen::HouseholderQR<MatrixXd>& qr,
                    const VectorXd& squared_lengths) {
  const VectorXd left = qr.matrixQR().diagonal().cwiseAbs();
  const VectorXd lengths = squared_lengths.cwiseSqrt();
  return lengths.allFinite() &&
         (left.array() >
          std::numeric_limits<double>::epsilon() * lengths.array())
             .all();
}

// R^-T b.
VectorXd SolveTransposedR(const Eigen::HouseholderQR<MatrixXd>& qr,
                          const VectorXd& b) {
  return qr.matrixQR()
      .topRows(qr.cols())
      .triangularView<Eigen::Upper>()
      .transpose()
      .solve(b);
}

}  // namespace

BlockAngularQr::BlockAngularQr(int64_t num_shared_columns)
    : squared_lengths_(VectorXd::Zero(num_shared_columns)) {}

void BlockAngularQr::Append(const MatrixXd& own, std::vector<int64_t> columns,
                            const MatrixXd& shared) {
  Block block{Qr(own), std::move(columns), shared};
  if (shared.cols() > 0) {  // Eigen would move a null pointer
    block.shared.applyOnTheLeft(block.qr.householderQ().adjoint());
  }
  is_independent_ =
      is_independent_ &&
      AreIndependent(block.qr, own.colwise().squaredNorm().transpose());
  for (size_t c = 0; c < block.columns.size(); ++c) {
    squared_lengths_[block.columns[c]] +=
        shared.col(static_cast<int64_t>(c)).squaredNorm();
  }
  num_rest_ += block.num_rest();
  blocks_.push_back(std::move(block));
}

bool BlockAngularQr::Factorize() {
  if (!is_independent_ || num_rest_ < squared_lengths_.size()) return false;
  MatrixXd H = MatrixXd::Zero(num_rest_, squared_lengths_.size());
  int64_t begin = 0;
  for (const Block& block : blocks_) {
    const int64_t count = block.num_rest();
    for (size_t c = 0; c < block.columns.size(); ++c) {
      H.col(block.columns[c]).segment(begin, count) =
          block.shared.col(static_cast<int64_t>(c)).tail(count);
    }
    begin += count;
  }
  rest_.compute(H);
  return AreIndependent(rest_, squared_lengths_);
}

// With A = Q R, x = Q R^-T rhs.
VectorXd BlockAngularQr::SolveLeastNorm(const VectorXd& rhs) const {
  VectorXd own(rhs.size() - squared_lengths_.size());
  VectorXd shared = rhs.tail(squared_lengths_.size());
  int64_t begin = 0;
  for (const Block& block : blocks_) {
    const int64_t count = block.num_own();
    const VectorXd top = SolveTransposedR(block.qr, rhs.segment(begin, count));
    own.segment(begin, count) = top;
    for (size_t c = 0; c < block.columns.size(); ++c) {
      shared[block.columns[c]] -=
          block.shared.col(static_cast<int64_t>(c)).head(count).dot(top);
    }
    begin += count;
  }
  VectorXd rest = VectorXd::Zero(num_rest_);
  rest.head(shared.size()) = SolveTransposedR(rest_, shared);
  rest.applyOnTheLeft(rest_.householderQ());

  VectorXd x(own.size() + num_rest_);
  int64_t own_begin = 0;
  int64_t rest_begin = 0;
  for (const Block& block : blocks_) {
    VectorXd part(block.qr.rows());
    part << own.segment(own_begin, block.num_own()),
        rest.segment(rest_begin, block.num_rest());
    part.applyOnTheLeft(block.qr.householderQ());
    x.segment(own_begin + rest_begin, part.size()) = part;
    own_begin += block.num_own();
    rest_begin += block.num_rest();
  }
  return x;
}

}  // namespace krot
