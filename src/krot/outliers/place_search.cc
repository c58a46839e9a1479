#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/base/parallel_for.h"
#include "krot/geometry/transform.h"
#include "krot/outliers/parts.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Matrix34d = Eigen::Matrix<double, 3, 4>;

// About so many pairs or triples of tracks are tried for a place and a scale.
constexpr int64_t kProposals = 300;

// M^-1, where M may be singular.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> InverseOf(
    const Eigen::Matrix<double, kSize, kSize>& M) {
  return (M + 1e-9 * M.trace() * M.Identity()).inverse();
}

// Coordinates in which the b sides of tracks, which may be small and far away,
// are near 1, so that their shift and their scale can be told apart.
class Unit {
 public:
  explicit Unit(const std::vector<SharedTrack>& tracks) {
    if (tracks.empty()) return;
    std::vector<Vector3d> a, b;
    for (const SharedTrack& track : tracks) {
      a.push_back(track.a.x);
      b.push_back(track.b.x);
    }
    centre_ = MedianPlace(b);
    length_ = MedianDistance(b, centre_);
    scale_ = MedianDistance(a, MedianPlace(a)) / length_;
  }

  Vector3d In(const Vector3d& x_b) const { return (x_b - centre_) / length_; }
  // About that of the a sides by that of the b sides.
  double scale() const { return scale_; }
  // Of a shift and a scale in these coordinates.
  Place PlaceOf(const Vector4d& shift_and_scale) const {
    Place place;
    place.scale = shift_and_scale(3) / length_;
    place.shift = shift_and_scale.head<3>() - place.scale * centre_;
    return place;
  }

 private:
  Vector3d centre_ = Vector3d::Zero();
  double length_ = 1;
  double scale_ = 1;
};

}  // namespace

Normal NormalOf(const KnownRotationProblem& problem,
                const std::vector<AffineMap>& cameras, const Side& side,
                const Vector3d& x) {
  Normal normal;
  for (const int64_t i : side.observations) {
    const Observation& o = problem.observations[i];
    const AffineMap& camera = cameras[o.view];
    const ViewedPoint viewed = ViewPoint(camera, o, x);
    if (!(viewed.depth > 0)) continue;
    const Eigen::Vector2d r = viewed.v / viewed.depth;
    const Eigen::Matrix<double, 2, 3> J =
        (o.E.bottomRows<2>() - r * o.E.row(0)) * camera.leftCols<3>() /
        viewed.depth;
    normal.H += J.transpose() * J;
    normal.g += J.transpose() * r;
  }
  return normal;
}

// The point of a track with the lowest cost, which is kCutOff variance_ at
// most: either group's, or the one that both agree on best.
std::pair<Vector3d, double> PlaceSearch::BestPoint(const SharedTrack& track,
                                                   const Place& place) const {
  const Vector3d x_b = place.scale * (place.rotation * track.b.x) + place.shift;
  const Matrix3d& H_a = track.a.H;
  const Matrix3d H_b = place.rotation * track.b.H * place.rotation.transpose() /
                       (place.scale * place.scale);
  const Vector3d both = InverseOf<3>(H_a + H_b) * (H_a * track.a.x + H_b * x_b);
  std::pair<Vector3d, double> best = {both, kCutOff * variance_};
  for (const Vector3d& x : {both, track.a.x, x_b}) {
    const double cost = CostAt(track, place, x, best.second);
    if (cost < best.second) best = {x, cost};
  }
  return best;
}

// The normal equations of a step of Gauss-Newton in the shift, the scale and
// the points of the tracks that agree, points eliminated; in the coordinates of
// Unit.
std::pair<Matrix4d, Vector4d> PlaceSearch::NormalOfPlace(
    const Place& place) const {
  const Unit unit(tracks_);
  Matrix4d S = Matrix4d::Zero();
  Vector4d rhs = Vector4d::Zero();
  for (const SharedTrack& track : tracks_) {
    const auto [x, cost] = BestPoint(track, place);
    if (!(cost < kCutOff * variance_)) continue;
    const Normal a = NormalOf(problem_, cameras_, track.a, x);
    Normal b =
        NormalOf(problem_, cameras_, track.b, (x - place.shift) / place.scale);
    b.H /= place.scale * place.scale;
    b.g /= place.scale;
    const Matrix3d H_b_M = b.H * InverseOf<3>(a.H + b.H);
    Matrix34d moves = Matrix34d::Identity();
    moves.col(3) = unit.In((x - place.shift) / place.scale);
    S += moves.transpose() * (b.H - H_b_M * b.H) * moves;
    rhs += moves.transpose() * (b.g - H_b_M * (a.g + b.g));
  }
  return {S, rhs};
}

Place PlaceSearch::Improve(const Place& place, bool is_scale_free) const {
  const auto [S, rhs] = NormalOfPlace(place);
  Place moved = place;
  if (is_scale_free) {
    const Place step = Unit(tracks_).PlaceOf(InverseOf<4>(S) * rhs);
    moved.shift += step.shift;
    moved.scale += step.scale;
    if (!(moved.scale > 0)) return place;
  } else {
    moved.shift += InverseOf<3>(S.topLeftCorner<3, 3>()) * rhs.head<3>();
  }
  moved.cost = Cost(moved, place.cost);
  return moved;
}

double PlaceSearch::ScaleDeviation(const Place& place) const {
  const Matrix4d S = NormalOfPlace(place).first;
  const Vector3d mixed = S.topRightCorner<3, 1>();
  // What is left of the scale's information, the shift eliminated. Rounding and
  // InverseOf leave up to some 1e-9 of it where nothing is left.
  const double information =
      S(3, 3) - mixed.dot(S.topLeftCorner<3, 3>().ldlt().solve(mixed));
  if (!(information > 1e-8 * S(3, 3))) {
    return std::numeric_limits<double>::infinity();
  }
  return Unit(tracks_).PlaceOf(Vector4d::Unit(3)).scale *
         std::sqrt(variance_ / information);
}

// For every track (t - x_a + scale x_b)' W (...) is to be small, with t the
// shift and W^-1 = H_a^-1 + scale^2 H_b^-1; two tracks determine t, and the
// scale, too, which W hardly depends on.
Matrix3d PlaceSearch::WeightOf(const SharedTrack& track, double scale) {
  const Matrix3d& H_a = track.a.H;
  return H_a - H_a * InverseOf<3>(H_a + track.b.H / (scale * scale)) * H_a;
}

Place PlaceSearch::BestPlace(double scale) const {
  const auto count = static_cast<int64_t>(tracks_.size());
  std::vector<Normal> of_shift(tracks_.size());
  for (size_t j = 0; j < tracks_.size(); ++j) {
    const SharedTrack& track = tracks_[j];
    of_shift[j].H = WeightOf(track, scale);
    of_shift[j].g = of_shift[j].H * (track.a.x - scale * track.b.x);
  }
  Place best;
  best.scale = scale;
  const int64_t stride = std::max<int64_t>(1, count * (count - 1) / 2 / 60);
  int64_t pair = 0;
  for (int64_t i = 0; i < count; ++i) {
    for (int64_t j = count > 1 ? i + 1 : i; j < count; ++j, ++pair) {
      if (pair % stride != 0) continue;
      Place place;
      place.scale = scale;
      place.shift = InverseOf<3>(of_shift[i].H + of_shift[j].H) *
                    (of_shift[i].g + of_shift[j].g);
      place.cost = Cost(place, best.cost);
      if (place.cost < best.cost) best = place;
    }
  }
  return ImproveAll(best, /*is_scale_free=*/false);
}

Place PlaceSearch::ImproveAll(Place best, bool is_scale_free) const {
  for (int n = 0; n < 5; ++n) {
    const Place moved = Improve(best, is_scale_free);
    if (!(moved.cost < best.cost)) break;
    best = moved;
  }
  return best;
}

std::vector<const SharedTrack*> PlaceSearch::TracksWithPoints() const {
  std::vector<const SharedTrack*> tracks;
  for (const SharedTrack& track : tracks_) {
    if (track.a.observations.size() >= 2 && track.b.observations.size() >= 2) {
      tracks.push_back(&track);
    }
  }
  return tracks;
}

// The similarity of three pairs of points by least squares [Umeyama 1991].
std::optional<Place> PlaceSearch::ProposeTurned() const {
  const std::vector<const SharedTrack*> tracks = TracksWithPoints();
  const auto count = static_cast<int64_t>(tracks.size());
  const int64_t num_triples = count * (count - 1) * (count - 2) / 6;
  const int64_t stride = std::max<int64_t>(1, num_triples / kProposals);
  Place best;
  // Triples until the next one that is tried. The others are not visited one by
  // one: there are some 10^9 of 2000 tracks.
  int64_t skip = 0;
  for (int64_t i = 0; i < count; ++i) {
    for (int64_t j = i + 1; j < count; ++j) {
      for (; skip < count - j - 1; skip += stride) {
        const int64_t k = j + 1 + skip;
        Matrix3d from, to;
        from << tracks[i]->b.x, tracks[j]->b.x, tracks[k]->b.x;
        to << tracks[i]->a.x, tracks[j]->a.x, tracks[k]->a.x;
        const Eigen::Matrix4d fit = Eigen::umeyama(from, to);
        Place place;
        place.scale = std::cbrt(fit.topLeftCorner<3, 3>().determinant());
        if (!(place.scale > 0) || !std::isfinite(place.scale)) continue;
        place.rotation = fit.topLeftCorner<3, 3>() / place.scale;
        place.shift = fit.topRightCorner<3, 1>();
        place.cost = Cost(place, best.cost);
        if (place.cost < best.cost) best = place;
      }
      skip -= count - j - 1;
    }
  }
  if (!std::isfinite(best.cost)) return std::nullopt;
  return best;
}

std::optional<Place> PlaceSearch::Propose() const {
  const auto count = static_cast<int64_t>(tracks_.size());
  if (count < 2) return std::nullopt;
  const Unit unit(tracks_);
  std::vector<Matrix4d> S(tracks_.size());
  std::vector<Vector4d> rhs(tracks_.size());
  for (size_t j = 0; j < tracks_.size(); ++j) {
    Matrix34d moves = Matrix34d::Identity();
    moves.col(3) = unit.In(tracks_[j].b.x);
    const Eigen::Matrix<double, 4, 3> weighed =
        moves.transpose() * WeightOf(tracks_[j], unit.scale());
    S[j] = weighed * moves;
    rhs[j] = weighed * tracks_[j].a.x;
  }
  Place best;
  ForSomePairs(count, kProposals, [&](int64_t i, int64_t j) {
    Place place = unit.PlaceOf(InverseOf<4>(S[i] + S[j]) * (rhs[i] + rhs[j]));
    if (!(place.scale > 0) || !std::isfinite(place.scale)) return;
    place.cost = Cost(place, best.cost);
    if (place.cost < best.cost) best = place;
  });
  if (!std::isfinite(best.cost)) return std::nullopt;
  return ImproveAll(best, /*is_scale_free=*/true);
}

std::vector<Place> PlaceSearch::Profile(const std::vector<double>& scales,
                                        const Context& context) const {
  std::vector<Place> places(scales.size());
  ParallelFor(
      static_cast<int64_t>(scales.size()), 1, context.num_threads,
      [&](int64_t n, int64_t, int) { places[n] = BestPlace(scales[n]); });
  std::stable_sort(
      places.begin(), places.end(),
      [](const Place& x, const Place& y) { return x.cost < y.cost; });
  return places;
}

}  // namespace krot::internal
