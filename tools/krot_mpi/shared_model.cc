#include "tools/krot_mpi/shared_model.h"

#include <utility>
#include <vector>

#include "krot/analysis/pixel_errors.h"
#include "krot/bridge/model_digest.h"

namespace krot {
namespace {

// What a solve changes of a point.
struct SolvedPoint {
  Eigen::Vector3d xyz;
  double error;
};

}  // namespace

Model SharedModel::Take(const Model& whole) {
  ModelShare share =
      TakeShare(whole, CutPoints(whole, ranks_.count())[ranks_.rank()]);
  point2D_of_ = std::move(share.point2D_of);
  return std::move(share.model);
}

bool SharedModel::Join(Model* model, Model* solved,
                       SolveSummary* summary) const {
  std::vector<SolvedPoint> points;
  for (const Point3D& point : solved->points3D) {
    points.push_back({point.xyz, point.error});
  }
  points = ranks_.GatherOnFirst(points);
  if (!ranks_.IsFirst()) return false;

  const Model share = std::exchange(*solved, Model());
  *model = Model();
  LogOptions quiet;
  quiet.level = 0;
  RunRecord again;
  *model = ReadInput(paths_, quiet, &again);
  *solved = *model;
  solved->frames = share.frames;
  for (size_t n = 0; n < share.images.size(); ++n) {
    solved->images[n].cam_from_world = share.images[n].cam_from_world;
  }
  size_t next = 0;
  for (const std::vector<int32_t>& cut : CutPoints(*model, ranks_.count())) {
    for (const int32_t k : cut) {
      solved->points3D[k].xyz = points[next].xyz;
      solved->points3D[k].error = points[next++].error;
    }
  }
  summary->pixel_error_before = Summarize(PixelErrors(*model));
  summary->pixel_error_after = Summarize(PixelErrors(*solved));
  if (summary->certificate) {
    summary->certificate->model_sha256 = ModelSha256(*model);
  }
  return true;
}

}  // namespace krot
