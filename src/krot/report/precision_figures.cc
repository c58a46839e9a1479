#include "krot/report/precision_figures.h"

#include <sstream>
#include <string_view>
#include <utility>

#include "krot/analysis/noise.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr double kHighCorrelation = 0.95;

}  // namespace

PrecisionFigures::PrecisionFigures(const AdjustmentPrecision& precision,
                                   const Model& model)
    : precision_(precision) {
  num_observations = static_cast<int64_t>(precision.observations.size());
  for (const PointPrecision& point : precision.points) {
    const Point3D& of = model.points3D[point.point];
    for (int n = 0; n < point.num_rays; ++n) {
      const ObservationPrecision& o = precision.observations[all.size()];
      const TrackElement& element = model.track_elements[o.element];
      all.push_back({&o, &model.images[o.image], element.point2D_idx, of.id,
                     o.residual_px.norm(),
                     StandardizedError(o.chi2, o.num_controlled)});
    }
    num_with_rays[point.num_rays]++;
    mean_angle_deg +=
        point.angle_deg / static_cast<double>(precision.points.size());
  }
  for (const NamedObservation& o : all) {
    num_tested += o.precision->num_controlled > 0;
    num_uncontrolled += o.precision->num_controlled < 2;
  }
  if (num_tested > 0) {
    critical_w = CriticalW(num_tested, NoiseOptions().false_alarm,
                           static_cast<double>(precision.redundancy));
  }
  for (const NamedObservation& o : all) num_above += o.w > critical_w;
}

template <typename Key>
std::vector<NamedObservation> PrecisionFigures::Worst(const Key& key) const {
  std::vector<NamedObservation> worst;
  for (const NamedObservation& o : all) {
    if (!std::isnan(key(o))) worst.push_back(o);
  }
  const auto count = std::min(worst.size(), kWorstRows);
  std::partial_sort(
      worst.begin(), worst.begin() + static_cast<std::ptrdiff_t>(count),
      worst.end(),
      [&](const auto& a, const auto& b) { return key(a) > key(b); });
  worst.resize(count);
  return worst;
}

std::vector<NamedObservation> PrecisionFigures::LargestResiduals() const {
  return Worst([](const NamedObservation& o) { return o.error_px; });
}

std::vector<NamedObservation> PrecisionFigures::LargestW() const {
  return Worst([](const NamedObservation& o) { return o.w; });
}

std::vector<PointPrecision> PrecisionFigures::SmallestAngles() const {
  std::vector<PointPrecision> points = precision_.points;
  std::stable_sort(
      points.begin(), points.end(),
      [](const auto& a, const auto& b) { return a.angle_deg < b.angle_deg; });
  points.resize(std::min(points.size(), kWorstRows));
  return points;
}

Vector3d PrecisionFigures::RmsSigma() const {
  Vector3d sum = Vector3d::Zero();
  int64_t count = 0;
  for (const PointPrecision& point : precision_.points) {
    if (!point.sigma.allFinite()) continue;
    sum += point.sigma.cwiseAbs2();
    ++count;
  }
  return (sum / static_cast<double>(count)).cwiseSqrt();
}

double PrecisionFigures::MedianDetectablePx() const {
  std::vector<double> values;
  for (const NamedObservation& o : all) {
    values.push_back(o.DetectablePx(precision_.sigma0_px));
  }
  return values.empty() ? kNaN : LowerMedian(std::move(values));
}

Eigen::VectorXd Deviations(const Eigen::MatrixXd& covariance) {
  return covariance.diagonal().cwiseMax(0).cwiseSqrt();
}

std::vector<Correlation> HighCorrelations(const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd sigma = Deviations(covariance);
  std::vector<Correlation> high;
  for (Eigen::Index a = 0; a < sigma.size(); ++a) {
    for (Eigen::Index b = 0; b < a; ++b) {
      const double value = covariance(a, b) / (sigma[a] * sigma[b]);
      if (std::abs(value) > kHighCorrelation) high.push_back({b, a, value});
    }
  }
  return high;
}

std::vector<std::string> ParamNames(int model_id) {
  std::istringstream names(std::string(FindCameraModel(model_id)->param_names));
  std::vector<std::string> list;
  for (std::string name; std::getline(names >> std::ws, name, ',');) {
    list.push_back(name);
  }
  return list;
}

}  // namespace krot::internal
