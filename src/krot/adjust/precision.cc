#include "krot/adjust/precision_system.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include <Eigen/Eigenvalues>

#include "krot/base/parallel_for.h"
#include "krot/check.h"
#include "krot/geometry.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

// The angle between two of a point's rays that is nearest to 90; degrees.
double MeetingAngle(const std::vector<Vector3d>& rays) {
  double largest = 0;
  for (size_t a = 0; a < rays.size(); ++a) {
    for (size_t b = 0; b < a; ++b) {
      const double sine = rays[a].cross(rays[b]).norm();
      largest =
          std::max(largest, std::atan2(sine, std::abs(rays[a].dot(rays[b]))));
    }
  }
  return largest * kDegreesPerRadian;
}

class PrecisionOfAdjustment {
 public:
  PrecisionOfAdjustment(const Model& model,
                        const BundleAdjustmentOptions& options,
                        const AdjustmentColumns& columns,
                        const AdjustmentBlocks& blocks, AdjustmentDatum datum,
                        const Context& context)
      : model_(model),
        columns_(columns),
        blocks_(blocks),
        num_threads_(context.num_threads),
        begin_(PointBegins(blocks)),
        gauges_(FindGauges(options, columns, blocks, datum)) {
    result_.datum = datum;
    result_.is_least_squares =
        options.loss == RobustLoss::kTrivial && !options.IsBounded();
    result_.num_unknowns = columns.num_unknowns;
    for (const ComponentGauge& gauge : gauges_) {
      result_.datum_defect += gauge.size();
    }
    result_.has_covariances =
        blocks.num_images <= options.max_num_images_direct_sparse;
  }

  AdjustmentPrecision Run() {
    DescribeErrors();
    if (result_.has_covariances) {
      covariance_.emplace(columns_, blocks_, gauges_, num_threads_);
      result_.num_undetermined = covariance_->num_undetermined();
    }
    result_.num_positions = static_cast<int64_t>(blocks_.positions.size());
    for (const DistanceObservation& distance : blocks_.distances) {
      result_.num_distances += distance.px_from_world > 0 ? 1 : 0;
    }
    result_.redundancy = 2 * static_cast<int64_t>(blocks_.observations.size()) +
                         3 * result_.num_positions + result_.num_distances -
                         result_.num_unknowns + result_.datum_defect +
                         result_.num_undetermined;
    squared_error_ += 2 * HalfSquaredSurvey(blocks_);
    if (result_.redundancy > 0) {
      result_.sigma0_px =
          std::sqrt(squared_error_ / static_cast<double>(result_.redundancy));
    }
    if (result_.has_covariances) {
      DescribePoints();
      DescribeImages();
      DescribeCameras();
    }
    DescribeDistances();
    return std::move(result_);
  }

 private:
  double Variance() const { return result_.sigma0_px * result_.sigma0_px; }
  std::optional<MatrixXd> CovarianceOf(const MatrixXd& J,
                                       const std::vector<int32_t>& blocks) {
    std::optional<MatrixXd> covariance = covariance_->Covariance(J, blocks);
    if (covariance) *covariance *= Variance();
    return covariance;
  }

  // Describes what needs no derivatives: errors, images and points.
  void DescribeErrors() {
    const std::vector<int32_t> image_of = ImagesOfElements(model_);
    const std::vector<ProjectedError> errors =
        *ProjectErrors(blocks_, kInfinity, num_threads_);
    std::vector<Vector3d> centers;
    for (const ImageGeometry& image : ImageGeometries(model_)) {
      centers.push_back(Center(image.cam_from_world));
    }
    std::map<int32_t, ImagePrecision> images;
    std::vector<Vector3d> rays;
    for (size_t i = 0; i < errors.size(); ++i) {
      const AdjustmentObservation& o = blocks_.observations[i];
      ObservationPrecision observation;
      observation.element = o.element;
      observation.image = image_of[o.element];
      observation.residual_px = errors[i].r;
      const double square = errors[i].r.squaredNorm();
      squared_error_ += square;
      result_.observations.push_back(observation);
      ImagePrecision& image = images[observation.image];
      if (image.num_observations++ == 0) {
        image.image = observation.image;
        parts_.push_back({observation.image, o.frame, o.sensor});
      }
      image.rms_px += errors[i].r.cwiseAbs2();
      image.max_px = std::max(image.max_px, std::sqrt(square));
      if (result_.points.empty() || result_.points.back().point != o.point) {
        result_.points.emplace_back();
        result_.points.back().point = o.point;
        rays.clear();
      }
      PointPrecision& point = result_.points.back();
      rays.push_back(centers[observation.image] - blocks_.points[o.point]);
      point.rms_px += square;
      ++point.num_rays;
      if (static_cast<int64_t>(i) + 1 == begin_[o.point + 1]) {
        point.rms_px = std::sqrt(point.rms_px / point.num_rays);
        point.angle_deg = MeetingAngle(rays);
      }
    }
    std::sort(parts_.begin(), parts_.end());
    for (auto& [index, image] : images) {
      image.rms_px =
          (image.rms_px / static_cast<double>(image.num_observations))
              .cwiseSqrt();
      result_.images.push_back(image);
    }
  }

  void DescribePoints() {
    ParallelForEach(
        static_cast<int64_t>(result_.points.size()), num_threads_,
        [&](int64_t n) { DescribePoint(&result_.points[n]); },
        /*chunk_size=*/64);
  }

  void DescribePoint(PointPrecision* point) {
    const PointCovariance covariance(*covariance_, point->point);
    for (int64_t i = begin_[point->point]; i < begin_[point->point + 1]; ++i) {
      DescribeRedundancy(covariance.RedundancyOf(i), &result_.observations[i]);
    }
    const std::optional<Matrix3d> of_point = covariance.OfPoint();
    point->sigma.setConstant(kInfinity);
    if (!of_point) return;
    point->sigma = (Variance() * of_point->diagonal()).cwiseMax(0).cwiseSqrt();
  }

  void DescribeRedundancy(const Matrix2d& R,
                          ObservationPrecision* observation) const {
    observation->redundancy = R.diagonal().cwiseMax(0).cwiseMin(1);
    if (!(Variance() > 0)) return;
    Eigen::SelfAdjointEigenSolver<Matrix2d> eigen;
    eigen.computeDirect(R);
    for (int j = 0; j < 2; ++j) {
      const double r = eigen.eigenvalues()[j];
      if (r < kControlled) continue;
      ++observation->num_controlled;
      const double along =
          eigen.eigenvectors().col(j).dot(observation->residual_px);
      observation->chi2 += along * along / (r * Variance());
    }
  }

  void DescribeImages() {
    for (size_t n = 0; n < parts_.size(); ++n) {
      const BlockJacobian pose = DifferentiatePose(
          columns_, blocks_, parts_[n].frame, parts_[n].sensor);
      const auto covariance = CovarianceOf(pose.J, pose.blocks);
      if (covariance) result_.images[n].covariance = *covariance;
    }
  }

  void DescribeCameras() {
    for (size_t c = 0; c < columns_.cameras.size(); ++c) {
      const AdjustmentColumns::Camera& camera = columns_.cameras[c];
      if (camera.params.empty()) continue;
      std::vector<int32_t> blocks(camera.num_blocks());
      std::iota(blocks.begin(), blocks.end(), camera.first_block);
      const auto count = static_cast<Index>(camera.params.size());
      const MatrixXd J =
          MatrixXd::Identity(count, 3 * Index{camera.num_blocks()});
      result_.cameras.push_back(
          {static_cast<int32_t>(c), camera.params, CovarianceOf(J, blocks)});
    }
  }

  void DescribeDistances() {
    for (const DistanceObservation& of : blocks_.distances) {
      result_.distances.push_back({of.index});
      if (!covariance_) continue;
      DistancePrecision& distance = result_.distances.back();
      const BlockJacobian length =
          DifferentiateLength(columns_, blocks_, of.ends);
      const auto variance = covariance_->Covariance(length.J, length.blocks);
      distance.sigma =
          variance ? std::sqrt(std::max(Variance() * (*variance)(0, 0), 0.0))
                   : kInfinity;
      if (of.px_from_world > 0 && variance) {
        distance.redundancy = std::clamp(
            1 - of.px_from_world * of.px_from_world * (*variance)(0, 0), 0.0,
            1.0);
        if (Variance() > 0 && distance.redundancy >= kControlled) {
          distance.w = ErrorPx(of, blocks_) /
                       std::sqrt(distance.redundancy * Variance());
        }
      }
    }
  }

  struct ImageParts {
    int32_t image, frame, sensor;
    bool operator<(const ImageParts& other) const {
      return image < other.image;
    }
  };
  const Model& model_;
  const AdjustmentColumns& columns_;
  const AdjustmentBlocks& blocks_;
  const int num_threads_;
  std::vector<int64_t> begin_;  // of points' observations; num_points + 1
  const std::vector<ComponentGauge> gauges_;
  std::optional<BlockCovariance> covariance_;
  std::vector<ImageParts> parts_;  // as result_.images
  double squared_error_ = 0;
  AdjustmentPrecision result_;
};

// Whether each point is nearer to a camera that sees it than a millionth of
// what is typical for its frame.
std::vector<char> LieInCameras(const AdjustmentBlocks& blocks) {
  const std::vector<double> typical =
      TypicalDistances(blocks, blocks.observations);
  std::vector<char> lie(blocks.points.size(), 0);
  for (const AdjustmentObservation& o : blocks.observations) {
    const Vector3d camera = PositionOf({o.frame, o.sensor, -1}, blocks);
    if ((blocks.points[o.point] - camera).norm() < 1e-6 * typical[o.frame]) {
      lie[o.point] = 1;
    }
  }
  return lie;
}

}  // namespace

AdjustmentPrecision FindPrecision(const Model& model,
                                  const BundleAdjustmentOptions& options,
                                  const AdjustmentBlocks& blocks,
                                  AdjustmentDatum datum,
                                  const Context& context) {
  const std::vector<char> lie = LieInCameras(blocks);
  AdjustmentBlocks kept = blocks;
  auto& observations = kept.observations;
  observations.erase(std::remove_if(observations.begin(), observations.end(),
                                    [&](const AdjustmentObservation& o) {
                                      return lie[o.point] != 0;
                                    }),
                     observations.end());
  AdjustmentColumns columns(options, kept);
  AddSurvey(model, options, &columns, &kept);
  AdjustmentPrecision precision =
      PrecisionOfAdjustment(model, options, columns, kept, datum, context)
          .Run();
  precision.num_points_in_cameras = std::count(lie.begin(), lie.end(), 1);
  return precision;
}

}  // namespace krot::internal
