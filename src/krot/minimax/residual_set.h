#pragma once

#include <vector>

#include "krot/minimax/residual.h"
#include "krot/minimax/residual_kernel.h"

namespace krot {

// The residuals of one problem (1), stored in blocks of lanes. Refilling it
// does not allocate once it has held as many.
class ResidualSet {
 public:
  void Clear() { size_ = 0; }
  // A row is a_1, b_1, a_2, b_2, c, d.
  void Add(const double row[kResidualRow]);
  void Add(const Residual& residual);

  int size() const { return size_; }
  Residual operator[](int i) const;

  // max_i r_i(x), the cost; infinity unless all depths are positive, 0 if
  // empty. values()[i] is r_i(x) afterwards.
  double Evaluate(const Eigen::Vector3d& x, Norm norm);
  const double* values() const { return values_.data(); }

 private:
  int size_ = 0;
  std::vector<ResidualBlock> blocks_;
  std::vector<double> values_;
};

}  // namespace krot
