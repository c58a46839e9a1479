#include "krot/report/model_report.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "krot/model/image_geometry.h"

namespace krot::internal {
namespace {

bool RepeatsAnImage(const Model& model, const Point3D& point) {
  std::set<ImageId> images;
  for (uint64_t n = point.track_begin; n < point.track_end; ++n) {
    if (!images.insert(model.track_elements[n].image_id).second) return true;
  }
  return false;
}

NoiseFigures FiguresOf(const Model& model, const ModelNoise& noise) {
  NoiseFigures figures;
  figures.sigma_px = noise.sigma_px;
  figures.cauchy_scale_px = noise.cauchy_scale_px;
  figures.critical_w = noise.critical_w;
  figures.num_tested = noise.num_tested;
  figures.num_above = noise.num_above;
  figures.num_above_by_image.assign(model.images.size(), 0);
  const auto image_of = ImageIndices(model);
  for (size_t e = 0; e < model.track_elements.size(); ++e) {
    figures.num_above_by_image[image_of.at(model.track_elements[e].image_id)] +=
        noise.observations[e].w > noise.critical_w;
  }
  std::vector<double> w;
  for (const ObservationNoise& one : noise.observations) {
    figures.num_half_controlled += one.num_controlled == 1;
    figures.num_uncontrolled += one.num_controlled == 0;
    if (one.num_controlled > 0) w.push_back(one.w);
  }
  if (w.empty()) return figures;
  std::sort(w.begin(), w.end());
  for (const double share : {0.5, 0.9, 0.99, 0.999}) {
    const double rank = std::ceil(share * static_cast<double>(w.size()));
    figures.quantiles.push_back({share, w[static_cast<size_t>(rank) - 1],
                                 std::sqrt(-2 * std::log1p(-share))});
  }
  return figures;
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
  Context context;
  context.num_threads = num_threads;
  report.noise = FiguresOf(model, EstimateNoise(model, {}, context));
  report.track_lengths = TrackLengthHistogram(model);
  report.num_tracks_with_repeated_image = std::count_if(
      model.points3D.begin(), model.points3D.end(),
      [&](const Point3D& point) { return RepeatsAnImage(model, point); });
  report.depth = ComputeDepthStatistics(model);
  report.triangulation_angle =
      ComputeTriangulationAngleStatistics(model, num_threads);
  return report;
}

}  // namespace krot::internal
