#include "krot/report/model_report.h"

#include <algorithm>
#include <set>

namespace krot {
namespace {

bool RepeatsAnImage(const Model& model, const Point3D& point) {
  std::set<ImageId> images;
  for (uint64_t n = point.track_begin; n < point.track_end; ++n) {
    if (!images.insert(model.track_elements[n].image_id).second) return true;
  }
  return false;
}

}  // namespace

ModelReport AnalyzeModel(const Model& model, int num_worst, int num_threads) {
  const std::vector<double> errors_px = PixelErrors(model, num_threads);
  ModelReport report;
  report.colmap = ComputeColmapStatistics(model);
  report.pixel_error = Summarize(errors_px);
  report.images = ErrorsByImage(model, errors_px);
  report.cameras = ErrorsByCamera(model, errors_px);
  report.worst = WorstObservations(model, errors_px, num_worst);
  report.track_lengths = TrackLengthHistogram(model);
  report.num_tracks_with_repeated_image = std::count_if(
      model.points3D.begin(), model.points3D.end(),
      [&](const Point3D& point) { return RepeatsAnImage(model, point); });
  report.depth = ComputeDepthStatistics(model);
  report.triangulation_angle =
      ComputeTriangulationAngleStatistics(model, num_threads);
  return report;
}

}  // namespace krot
