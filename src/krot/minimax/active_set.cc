#include "krot/minimax/active_set.h"

#include <algorithm>

namespace krot {

void FindDescentNormals(const ResidualSet& residuals, const Eigen::Vector3d& x,
                        Norm norm, double active_tolerance,
                        std::vector<Eigen::Vector3d>* descent_normals) {
  descent_normals->clear();
  const double* values = residuals.values();
  const double cost = *std::max_element(values, values + residuals.size());
  const double share = 1 - active_tolerance;
  for (int i = 0; i < residuals.size(); ++i) {
    if (values[i] < share * cost) continue;  // (5)
    ResidualPiece pieces[kMaxPieces];
    const int count = ResidualPieces(residuals[i], x, norm, share, pieces);
    for (int k = 0; k < count; ++k) {
      const double length = pieces[k].gradient.norm();
      if (!(length > 0)) continue;
      descent_normals->push_back(-pieces[k].gradient / length);  // (6)
    }
  }
}

}  // namespace krot
