#include "krot/minimax/residual_set.h"

namespace krot {

void ResidualSet::Add(const double row[kResidualRow]) {
  const int block = size_ / kResidualLanes;
  const int lane = size_ % kResidualLanes;
  if (block == static_cast<int>(blocks_.size())) {
    blocks_.emplace_back();
    values_.resize(values_.size() + kResidualLanes);
  }
  if (lane == 0) {  // idle lanes: r = 0 / 1
    blocks_[block] = {};
    for (double& d : blocks_[block].row[11]) d = 1;
  }
  for (int k = 0; k < kResidualRow; ++k) blocks_[block].row[k][lane] = row[k];
  ++size_;
}

void ResidualSet::Add(const Residual& residual) {
  double row[kResidualRow];
  for (int k = 0; k < 3; ++k) {
    row[k] = residual.A(0, k);
    row[4 + k] = residual.A(1, k);
    row[8 + k] = residual.c[k];
  }
  row[3] = residual.b[0];
  row[7] = residual.b[1];
  row[11] = residual.d;
  Add(row);
}

Residual ResidualSet::operator[](int i) const {
  const auto& row = blocks_[i / kResidualLanes].row;
  const int lane = i % kResidualLanes;
  Residual residual;
  for (int k = 0; k < 3; ++k) {
    residual.A(0, k) = row[k][lane];
    residual.A(1, k) = row[4 + k][lane];
    residual.c[k] = row[8 + k][lane];
  }
  residual.b = {row[3][lane], row[7][lane]};
  residual.d = row[11][lane];
  return residual;
}

double ResidualSet::Evaluate(const Eigen::Vector3d& x, Norm norm) {
  const int num_blocks = (size_ + kResidualLanes - 1) / kResidualLanes;
  return EvaluateResiduals(blocks_.data(), num_blocks, norm.p, x.data(),
                           values_.data());
}

}  // namespace krot
