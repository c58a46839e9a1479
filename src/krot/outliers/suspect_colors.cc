#include "krot/outliers/suspect_colors.h"

#include <unordered_set>

namespace krot::internal {

void ColorSuspects(const OutlierFilterSummary& summary, Model* model) {
  std::unordered_set<Point3DId> removed, in_conflict;
  for (const RemovedObservation& o : summary.removed) {
    removed.insert(o.point3D_id);
  }
  if (summary.conflicts) {
    for (const ConflictFile::Conflict& conflict :
         summary.conflicts->conflicts) {
      for (const CertificateFile::SupportObservation& o :
           conflict.observations) {
        in_conflict.insert(o.point3D_id);
      }
    }
  }
  for (Point3D& point : model->points3D) {
    point.color = removed.count(point.id) > 0       ? kRemovedColor
                  : in_conflict.count(point.id) > 0 ? kConflictColor
                                                    : kUnsuspectedColor;
  }
}

}  // namespace krot::internal
