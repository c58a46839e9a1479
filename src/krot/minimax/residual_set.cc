#include "krot/minimax/residual_set.h"

namespace krot::internal {

// A block whose lanes are idle: r = 0 / 1.
void ResidualSet::AddBlock() {
  const size_t block = size_ / kResidualLanes;
  if (block == blocks_.size()) {
    blocks_.emplace_back();
    values_.resize(values_.size() + kResidualLanes);
  }
  blocks_[block] = {};
  for (double& d : blocks_[block].row[11]) d = 1;
}

void ResidualSet::AddFrom(const ResidualSet& other, int i) {
  double row[kResidualRow];
  const ResidualBlock& block = other.blocks_[i / kResidualLanes];
  for (int k = 0; k < kResidualRow; ++k) {
    row[k] = block.row[k][i % kResidualLanes];
  }
  Add(row);
}

double ResidualSet::Evaluate(const Eigen::Vector3d& x, Norm norm) {
  return EvaluateResiduals(blocks_.data(), num_blocks(), norm.p, x.data(),
                           values_.data());
}

}  // namespace krot::internal
