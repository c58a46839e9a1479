#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "krot/analysis/camera_check.h"
#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/linear/blocks.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;

// For smaller lambda the density is nearly even, and a series replaces formulas
// that would lose digits.
constexpr double kFlat = 1e-4;
// So many points may be seen at the same pixels by chance.
constexpr size_t kChancePoints = 15;

// The mean of the density lambda exp(-lambda u) / (1 - exp(-lambda)) on [0, 1].
double MeanInDisc(double lambda) {
  return lambda < kFlat ? 0.5 - lambda / 12
                        : 1 / lambda - 1 / std::expm1(lambda);
}

// log(lambda / (1 - exp(-lambda))).
double LogFactorInDisc(double lambda) {
  return lambda < kFlat ? lambda / 2 : std::log(lambda / -std::expm1(-lambda));
}

// The same for the density f exp(-lambda u) / (2 sqrt(u)), whose factor is f.
double LogFactorOnSegment(double lambda) {
  if (lambda < kFlat) return lambda / 3;
  const double root = std::sqrt(lambda);
  return std::log(2 * root / (std::sqrt(kPi) * std::erf(root)));
}

double MeanOnSegment(double lambda) {
  if (lambda < kFlat) return 1.0 / 3 - 4.0 / 45 * lambda;
  return (1 - std::exp(LogFactorOnSegment(lambda) - lambda)) / (2 * lambda);
}

// How far, RMS, the pixels that see a point are from their mean; infinite where
// fewer than three images see it, and where their cameras turn so little that a
// distant point would be seen at one pixel up to `moved_px`.
double RmsIfStill(const Model& model,
                  const std::vector<ImageGeometry>& geometries,
                  const std::vector<int32_t>& image_of, const Point3D& point,
                  double moved_px) {
  std::vector<int32_t> images;
  Vector2d mean = Vector2d::Zero();
  const auto pixel_of = [&](uint64_t e) {
    const Point2D& pixel =
        model.images[image_of[e]].points2D[model.track_elements[e].point2D_idx];
    return Vector2d(pixel.x, pixel.y);
  };
  for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
    images.push_back(image_of[e]);
    mean += pixel_of(e);
  }
  const auto count = static_cast<double>(images.size());
  mean /= count;
  std::sort(images.begin(), images.end());
  images.erase(std::unique(images.begin(), images.end()), images.end());
  double sum = 0;
  for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
    sum += (pixel_of(e) - mean).squaredNorm();
  }
  const double rms = std::sqrt(sum / count);
  if (images.size() < 3 || rms > moved_px) return kInfinity;
  std::optional<Vector3d> first;
  for (const int32_t n : images) {
    const ImageGeometry& geometry = geometries[n];
    if (!geometry.has_pose) continue;
    const Camera& camera = model.cameras[geometry.camera];
    const auto ray = PixelBearing(camera, mean);
    const auto beside = PixelBearing(camera, mean + Vector2d(moved_px, 0));
    if (!ray || !beside) continue;
    const Vector3d in_world =
        geometry.cam_from_world.rotation.transpose() * *ray;
    if (!first) first = in_world;
    if ((in_world - *first).norm() > (*ray - *beside).norm()) return rms;
  }
  return kInfinity;
}

}  // namespace

ErrorsInDisc::ErrorsInDisc(const std::vector<double>& errors_px,
                           const std::vector<double>& errors_of_two_px,
                           double limit_px) {
  const auto add = [&](const std::vector<double>& errors, double weight,
                       int64_t* count) {
    for (const double error : errors) {
      if (!(error <= limit_px) || limit_px == 0) continue;
      ++*count;
      mean_ += weight * error * error / (limit_px * limit_px);
    }
  };
  add(errors_px, 1, &num_in_disc_);
  add(errors_of_two_px, 2, &num_on_segment_);
  if (num() == 0) return;
  mean_ = std::min(MeanAt(0), mean_ / static_cast<double>(num()));
  if (mean_ == MeanAt(0)) return;
  double low = 0;
  double high = 1 / std::max(mean_, std::numeric_limits<double>::min());
  for (double middle = high / 2; low < middle && middle < high;
       middle = low + (high - low) / 2) {
    (MeanAt(middle) > mean_ ? low : high) = middle;
  }
  lambda_ = low;
}

double ErrorsInDisc::MeanAt(double lambda) const {
  return (static_cast<double>(num_in_disc_) * MeanInDisc(lambda) +
          2 * static_cast<double>(num_on_segment_) *
              MeanOnSegment(2 * lambda)) /
         static_cast<double>(num());
}

double ErrorsInDisc::LogFactors(double lambda) const {
  return static_cast<double>(num_in_disc_) * LogFactorInDisc(lambda) +
         static_cast<double>(num_on_segment_) * LogFactorOnSegment(2 * lambda);
}

double ErrorsInDisc::Exponent(double other) const {
  return LogFactors(lambda_) - LogFactors(other) +
         (other - lambda_) * mean_ * static_cast<double>(num());
}

std::vector<ErrorsInDisc> FillDiscs(const Model& model,
                                    const std::vector<double>& errors_px) {
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::vector<std::vector<double>> of_two(model.images.size());
  std::vector<std::vector<double>> of_more(model.images.size());
  std::vector<double> all;
  for (const Point3D& point : model.points3D) {
    auto& of_image =
        point.track_end - point.track_begin == 2 ? of_two : of_more;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!std::isfinite(errors_px[e])) continue;
      of_image[image_of[e]].push_back(errors_px[e]);
      all.push_back(errors_px[e]);
    }
  }
  double limit = 0;
  if (!all.empty()) {
    const auto rank = all.begin() + (999 * all.size() - 1) / 1000;
    std::nth_element(all.begin(), rank, all.end());
    limit = *rank;
  }
  std::vector<ErrorsInDisc> discs;
  for (size_t n = 0; n < model.images.size(); ++n) {
    discs.emplace_back(of_more[n], of_two[n], limit);
  }
  return discs;
}

namespace {

// Of a track, `error` and its derivatives `F` by the pose and `A` by the point;
// root G with G G' = (A'A)^-1 over the whole track.
template <int N>
void Add(const Eigen::Matrix<double, N, 6>& F,
         const Eigen::Matrix<double, N, 3>& A,
         const Eigen::Matrix<double, N, 1>& error, const Matrix3d& root,
         PoseSums* sums) {
  using Square = Eigen::Matrix<double, N, N>;
  const Eigen::Matrix<double, N, 3> B = A * root;
  const Square R =
      Square::Identity(B.rows(), B.rows()) - Square(B * B.transpose());
  const auto [values, vectors] = [&R] {
    if constexpr (N == 2) {
      Eigen::SelfAdjointEigenSolver<Square> of_R;
      of_R.computeDirect(R);
      return std::pair(of_R.eigenvalues(), of_R.eigenvectors());
    } else {
      return EigenpairsOf(R);
    }
  }();
  for (Index j = 0; j < R.rows(); ++j) {
    const double r = values[j];
    if (r < kControlled) continue;
    const Eigen::Matrix<double, N, 1> direction = vectors.col(j);
    const Vector6 f = F.transpose() * direction;
    const double along = direction.dot(error);
    sums->M.noalias() += r * f * f.transpose();
    sums->g.noalias() += along * f;
    sums->square += along * along / r;
    ++sums->num_directions;
  }
}

void FindSteps(std::vector<PoseSums>* sums) {
  for (PoseSums& one : *sums) one.step = DeterminedStep(one.M, one.g);
}

// 1 / sqrt of the smallest eigenvalue of A - B C^-1 B'; infinite if nothing
// holds.
double LargestSpread(const Matrix3d& A, const Matrix3d& B, const Matrix3d& C) {
  const Matrix3d S = A - B * C.ldlt().solve(B.transpose());
  if (!S.allFinite()) return kInfinity;
  const Vector3d values =
      Eigen::SelfAdjointEigenSolver<Matrix3d>(S, Eigen::EigenvaluesOnly)
          .eigenvalues();
  const bool is_held = values[0] > kNoDirection * A.trace();
  return is_held ? 1 / std::sqrt(values[0]) : kInfinity;
}

}  // namespace

double PoseSums::CenterSpread() const {
  return LargestSpread(M.bottomRightCorner<3, 3>(), M.bottomLeftCorner<3, 3>(),
                       M.topLeftCorner<3, 3>());
}

double PoseSums::TurnSpread() const {
  return LargestSpread(M.topLeftCorner<3, 3>(), M.topRightCorner<3, 3>(),
                       M.bottomRightCorner<3, 3>());
}

double PoseSums::GainExponent(double sigma_px) const {
  return internal::GainExponent(Gain(), square, num_directions, 6, sigma_px);
}

std::vector<PoseSums> AddUpImages(const Model& model, const ModelNoise& noise) {
  const PoseRows all(model, noise);
  std::vector<PoseSums> sums(model.images.size());
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const std::vector<PoseRow> rows = all.Of(k);
    const Matrix3d root = PoseRows::RootOf(rows);
    for (const PoseRow& row : rows) {
      Add<2>(row.F, row.F.rightCols<3>(), row.error, root, &sums[row.image]);
    }
  }
  FindSteps(&sums);
  return sums;
}

std::vector<PoseSums> AddUpFrames(const Model& model, const ModelNoise& noise) {
  const bool has_rigs =
      std::any_of(model.frames.begin(), model.frames.end(),
                  [](const Frame& frame) { return frame.data.size() > 1; });
  if (!has_rigs) return AddUpImages(model, noise);
  const PoseRows all(model, noise);
  std::vector<PoseSums> sums(model.frames.size());
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const std::vector<PoseRow> rows = all.Of(k);
    const Matrix3d root = PoseRows::RootOf(rows);
    std::map<int32_t, std::vector<const PoseRow*>> of_frames;
    for (const PoseRow& row : rows) {
      of_frames[all.geometries()[row.image].frame].push_back(&row);
    }
    for (const auto& [frame, of_frame] : of_frames) {
      const auto size = static_cast<Index>(2 * of_frame.size());
      Eigen::Matrix<double, Eigen::Dynamic, 6> F(size, 6);
      Eigen::Matrix<double, Eigen::Dynamic, 3> A(size, 3);
      Eigen::VectorXd error(size);
      for (Index i = 0; i < size; i += 2) {
        const PoseRow& row = *of_frame[i / 2];
        F.middleRows<2>(i) = all.ByFrame(row);
        A.middleRows<2>(i) = row.F.rightCols<3>();
        error.segment<2>(i) = row.error;
      }
      Add<Eigen::Dynamic>(F, A, error, root, &sums[frame]);
    }
  }
  FindSteps(&sums);
  std::vector<PoseSums> of_images(model.images.size());
  for (size_t n = 0; n < of_images.size(); ++n) {
    const ImageGeometry& geometry = all.geometries()[n];
    if (geometry.has_pose) of_images[n] = sums[geometry.frame];
  }
  return of_images;
}

double ErrorCorrelation(const Model& model, const ModelNoise& noise) {
  if (noise.sigma_px.value_or(0) < kLeastNoisePx) return 0;
  constexpr double kOtherPixels = 10;
  struct Observation {
    Vector2d pixel, error;
    int32_t point;
  };
  std::vector<std::vector<Observation>> of_images(model.images.size());
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  const std::vector<int32_t> point_of = PointsOfElements(model);
  for (size_t e = 0; e < image_of.size(); ++e) {
    const ObservationNoise& one = noise.observations[e];
    if (one.num_controlled == 0) continue;
    const Point2D& pixel =
        model.images[image_of[e]].points2D[model.track_elements[e].point2D_idx];
    of_images[image_of[e]].push_back(
        {{pixel.x, pixel.y}, one.error_px / one.relative_sigma, point_of[e]});
  }
  double products = 0, squares = 0, num = 0;
  for (std::vector<Observation>& all : of_images) {
    std::sort(all.begin(), all.end(),
              [](const Observation& a, const Observation& b) {
                return std::pair(a.pixel.x(), a.pixel.y()) <
                       std::pair(b.pixel.x(), b.pixel.y());
              });
    for (size_t i = 0; i < all.size(); ++i) {
      double distance = kInfinity;
      const Observation* nearest = nullptr;
      // False: none beyond can be nearer.
      const auto ask = [&](const Observation& other) {
        const Vector2d away = other.pixel - all[i].pixel;
        if (std::abs(away.x()) > distance) return false;
        if (other.point != all[i].point && away.norm() >= kOtherPixels &&
            away.norm() < distance) {
          distance = away.norm();
          nearest = &other;
        }
        return true;
      };
      for (size_t j = i + 1; j < all.size() && ask(all[j]); ++j) continue;
      for (size_t j = i; j > 0 && ask(all[j - 1]); --j) continue;
      if (nearest == nullptr) continue;
      products += all[i].error.dot(nearest->error);
      squares +=
          (all[i].error.squaredNorm() + nearest->error.squaredNorm()) / 2;
      ++num;
    }
  }
  return squares > 0 ? products / squares - 3 / std::sqrt(num) : 0;
}

// Points that hardly move by chance are as often within the next pixel as
// within the first one.
std::vector<int32_t> FindStillPoints(const Model& model) {
  constexpr double kStillPx = 1;
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::vector<int32_t> still;
  size_t num_near = 0;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const double rms = RmsIfStill(model, geometries, image_of,
                                  model.points3D[k], 2 * kStillPx);
    if (rms <= kStillPx) {
      still.push_back(static_cast<int32_t>(k));
    } else {
      num_near += rms <= 2 * kStillPx;
    }
  }
  if (still.size() <= kChancePoints + 2 * num_near) still.clear();
  return still;
}

std::vector<std::array<int32_t, 2>> FindSamePhotos(const Model& model) {
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::vector<int64_t> num_observations(model.images.size(), 0);
  std::map<std::array<int32_t, 2>, int64_t> num_same;
  std::vector<std::tuple<double, double, int32_t>> sights;  // x, y, image
  for (const Point3D& point : model.points3D) {
    sights.clear();
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const int32_t n = image_of[e];
      const uint32_t i = model.track_elements[e].point2D_idx;
      const Point2D& pixel = model.images[n].points2D[i];
      sights.emplace_back(pixel.x, pixel.y, n);
      ++num_observations[n];
    }
    std::sort(sights.begin(), sights.end());
    for (size_t j = 1; j < sights.size(); ++j) {
      const auto& [x1, y1, image1] = sights[j - 1];
      const auto& [x2, y2, image2] = sights[j];
      if (x1 == x2 && y1 == y2 && image1 != image2)
        ++num_same[{image1, image2}];
    }
  }
  std::vector<std::array<int32_t, 2>> same;
  for (const auto& [images, num] : num_same) {
    const int64_t fewer =
        std::min(num_observations[images[0]], num_observations[images[1]]);
    // A few pixels agree by chance where they are rounded.
    if (num > int64_t{kChancePoints} && 2 * num > fewer) same.push_back(images);
  }
  return same;
}

}  // namespace krot::internal
