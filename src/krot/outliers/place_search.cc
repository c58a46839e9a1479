#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/base/parallel_for.h"
#include "krot/outliers/parts.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// About so many pairs or triples of tracks are tried for a place and a scale.
constexpr int64_t kProposals = 300;

// M^-1, where M may be singular.
Matrix3d InverseOf(const Matrix3d& M) {
  return (M + 1e-9 * M.trace() * Matrix3d::Identity()).inverse();
}

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

// The point of a track with the lowest cost: either group's, or the one that
// both agree on best.
std::pair<Vector3d, double> PlaceSearch::BestPoint(const SharedTrack& track,
                                                   const Place& place) const {
  const Vector3d x_b = place.scale * (place.rotation * track.b.x) + place.shift;
  const Matrix3d& H_a = track.a.H;
  const Matrix3d H_b = place.rotation * track.b.H * place.rotation.transpose() /
                       (place.scale * place.scale);
  const Vector3d both = InverseOf(H_a + H_b) * (H_a * track.a.x + H_b * x_b);
  std::pair<Vector3d, double> best = {both, CostAt(track, place, both)};
  for (const Vector3d& x : {track.a.x, x_b}) {
    const double cost = CostAt(track, place, x);
    if (cost < best.second) best = {x, cost};
  }
  return best;
}

// A step of Gauss-Newton in the shift and the points of the tracks that agree.
Place PlaceSearch::Improve(const Place& place) const {
  Matrix3d S = Matrix3d::Zero();
  Vector3d rhs = Vector3d::Zero();
  for (const SharedTrack& track : tracks_) {
    const auto [x, cost] = BestPoint(track, place);
    if (!(cost < kCutOff * variance_)) continue;
    const Normal a = NormalOf(problem_, cameras_, track.a, x);
    Normal b =
        NormalOf(problem_, cameras_, track.b, (x - place.shift) / place.scale);
    b.H /= place.scale * place.scale;
    b.g /= place.scale;
    const Matrix3d H_b_M = b.H * InverseOf(a.H + b.H);
    S += b.H - H_b_M * b.H;
    rhs += b.g - H_b_M * (a.g + b.g);
  }
  Place moved = place;
  moved.shift += InverseOf(S) * rhs;
  moved.cost = Cost(moved, place.cost);
  return moved;
}

// For every track (t - x_a + scale x_b)' W (...) is to be small, with t the
// shift and W^-1 = H_a^-1 + H_b^-1; two tracks determine t.
Place PlaceSearch::BestPlace(double scale) const {
  const auto count = static_cast<int64_t>(tracks_.size());
  std::vector<Normal> of_shift(tracks_.size());
  for (size_t j = 0; j < tracks_.size(); ++j) {
    const Side& a = tracks_[j].a;
    const Side& b = tracks_[j].b;
    of_shift[j].H = a.H - a.H * InverseOf(a.H + b.H / (scale * scale)) * a.H;
    of_shift[j].g = of_shift[j].H * (a.x - scale * b.x);
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
      place.shift = InverseOf(of_shift[i].H + of_shift[j].H) *
                    (of_shift[i].g + of_shift[j].g);
      place.cost = Cost(place, best.cost);
      if (place.cost < best.cost) best = place;
    }
  }
  for (int n = 0; n < 5; ++n) {
    const Place moved = Improve(best);
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
  int64_t triple = 0;
  for (int64_t i = 0; i < count; ++i) {
    for (int64_t j = i + 1; j < count; ++j) {
      for (int64_t k = j + 1; k < count; ++k, ++triple) {
        if (triple % stride != 0) continue;
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
    }
  }
  if (!std::isfinite(best.cost)) return std::nullopt;
  return best;
}

std::optional<Place> PlaceSearch::Propose() const {
  const std::vector<const SharedTrack*> tracks = TracksWithPoints();
  const auto count = static_cast<int64_t>(tracks.size());
  if (count < kStrongTracks) return std::nullopt;
  Place best;
  ForSomePairs(count, kProposals, [&](int64_t i, int64_t j) {
    const Vector3d between_a = tracks[i]->a.x - tracks[j]->a.x;
    const Vector3d between_b = tracks[i]->b.x - tracks[j]->b.x;
    Place place;
    place.scale = between_a.dot(between_b) / between_b.squaredNorm();
    if (!(place.scale > 0) || !std::isfinite(place.scale)) return;
    place.shift = (tracks[i]->a.x + tracks[j]->a.x -
                   place.scale * (tracks[i]->b.x + tracks[j]->b.x)) /
                  2;
    place.cost = Cost(place, best.cost);
    if (place.cost < best.cost) best = place;
  });
  if (!std::isfinite(best.cost)) return std::nullopt;
  return best;
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
