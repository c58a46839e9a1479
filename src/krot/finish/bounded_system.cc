#include "krot/finish/bounded_system.h"

#include <cmath>

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix23 = Eigen::Matrix<double, 2, 3>;
using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr int64_t kBlocksPerChunk = 512;

// J of e = v / w.
Matrix23 ErrorRows(const Observation& observation, const ViewedPoint& viewed) {
  const Eigen::Vector2d e = viewed.v / viewed.depth;
  return (observation.E.bottomRows<2>() - e * observation.E.row(0)) /
         viewed.depth;
}

// R of A = Q R by modified Gram-Schmidt, which finds it as accurately as
// reflections do.
template <int kRows>
Matrix3d Triangle(Eigen::Matrix<double, kRows, 3> A) {
  Matrix3d R = Matrix3d::Zero();
  for (int c = 0; c < 3; ++c) {
    R(c, c) = A.col(c).norm();
    A.col(c) /= R(c, c);
    for (int d = c + 1; d < 3; ++d) {
      R(c, d) = A.col(c).dot(A.col(d));
      A.col(d) -= R(c, d) * A.col(c);
    }
  }
  return R;
}

}  // namespace

template <typename Cone>
BoundedSystem<Cone>::BoundedSystem(const KnownRotationProblem& problem,
                                   Norm norm, double cap, const ErrorLoss& loss,
                                   int num_threads)
    : problem_(problem),
      cap_(cap),
      loss_(loss),
      loop_(static_cast<int64_t>(problem.observations.size()), num_threads),
      structure_(AnchoredStructure(problem)),
      T_(ConeMap<Cone::kDim>(norm)),
      elimination_(structure_, num_threads),
      scaling_(problem.observations.size()),
      lambda_(problem.observations.size()),
      target_(problem.observations.size()),
      pull_(problem.observations.size()) {
  direction_.ds.resize(problem.observations.size());
  direction_.dz.resize(problem.observations.size());
}

template <typename Cone>
double BoundedSystem<Cone>::Barrier(const ViewedPoint& viewed) const {
  const Vector share = Slack(viewed) / (cap_ * viewed.depth);
  if constexpr (Cone::kDim == 3) {
    return -std::log(Cone::Determinant(share)) / 2;
  } else {
    return -share.array().log().sum();
  }
}

template <typename Cone>
bool BoundedSystem<Cone>::Factorize(
    const std::vector<Observation>& observations,
    const std::vector<ViewedPoint>& viewed, const std::vector<Vector>& z) {
  constexpr int kDim = Cone::kDim;
  observations_ = &observations;
  viewed_ = &viewed;
  loop_.ForEach([&](int64_t i) {
    scaling_[i] = NtScaling<Cone>(Slack(viewed[i]), z[i]);
    lambda_[i] = scaling_[i].Apply(z[i]);
    const Observation& o = observations[i];
    const View& view = problem_.views[o.view];
    Eigen::Matrix<double, kDim + 2, 3> rows;  // of (w; v)
    for (int c = 0; c < 3; ++c) {
      rows.col(c).template head<kDim>() = scaling_[i].ApplyInverse(T_.col(c));
    }
    rows.col(0).template head<kDim>() *= cap_;
    const Eigen::Vector2d e = viewed[i].v / viewed[i].depth;
    const double weight =
        std::sqrt(loss_.Weight(e.squaredNorm())) / viewed[i].depth;
    rows.template bottomRows<2>() << -weight * e,
        weight * Eigen::Matrix2d::Identity();
    const Matrix3d R = Triangle<kDim + 2>(rows) * o.E;
    Eigen::Map<RowMajor3>(elimination_.point_rows(i)).noalias() =
        R * view.cam_from_world_rotation;
    Eigen::Map<RowMajor3>(elimination_.frame_rows(i)).noalias() =
        R * view.cam_from_rig_rotation;
  });
  mu_ = loop_.Sum([&](int64_t i) { return lambda_[i].squaredNorm(); }) /
        static_cast<double>(loop_.count() * Cone::kDegree);
  return elimination_.Factorize();
}

// A'f - J'rho' e - degree mu c / w, of points and frames: in their order, so
// with the same bits at any number of threads.
template <typename Cone>
void BoundedSystem<Cone>::FindGradient(double mu) {
  loop_.ForEach([&](int64_t i) {
    const Observation& o = (*observations_)[i];
    const ViewedPoint& viewed = (*viewed_)[i];
    const Eigen::Vector2d e = viewed.v / viewed.depth;
    const Vector3d f = T_.transpose() * scaling_[i].ApplyInverse(target_[i]);
    Vector3d wv(cap_ * f[0] - Cone::kDegree * mu / viewed.depth, f[1], f[2]);
    pull_[i] = o.E.transpose() * wv - ErrorRows(o, viewed).transpose() *
                                          (loss_.Weight(e.squaredNorm()) * e);
  });
  gradient_.SetZero(problem_.num_points, problem_.num_frames);
  ParallelFor(problem_.num_points, kBlocksPerChunk, loop_.num_threads(),
              [&](int64_t begin, int64_t end, int) {
                for (int64_t k = begin; k < end; ++k) {
                  for (int64_t i = problem_.point_begin[k];
                       i < problem_.point_begin[k + 1]; ++i) {
                    const View& view =
                        problem_.views[problem_.observations[i].view];
                    gradient_.points[k].noalias() +=
                        view.cam_from_world_rotation.transpose() * pull_[i];
                  }
                }
              });
  ParallelFor(problem_.num_frames, 1, loop_.num_threads(),
              [&](int64_t f, int64_t, int) {
                if (structure_.frame_is_fixed[f]) return;
                for (int64_t n = problem_.frame_begin[f];
                     n < problem_.frame_begin[f + 1]; ++n) {
                  const int64_t i = problem_.frame_observations[n];
                  const View& view =
                      problem_.views[problem_.observations[i].view];
                  gradient_.frames[f].noalias() +=
                      view.cam_from_rig_rotation.transpose() * pull_[i];
                }
              });
}

template <typename Cone>
void BoundedSystem<Cone>::SolveForTarget(double mu) {
  FindGradient(mu);
  Direction& d = direction_;
  elimination_.Solve(gradient_, nullptr, &d.dx, /*refinements=*/0);
  slope_ = gradient_.Dot(d.dx);
  loop_.ForEach([&](int64_t i) {
    const Observation& o = (*observations_)[i];
    const View& view = problem_.views[o.view];
    const Vector3d dwv =
        o.E * (view.cam_from_world_rotation * d.dx.points[o.point] +
               view.cam_from_rig_rotation * d.dx.frames[view.frame]);
    d.ds[i] =
        scaling_[i].ApplyInverse(T_ * Vector3d(cap_ * dwv[0], dwv[1], dwv[2]));
    d.dz[i] = target_[i] - lambda_[i] - d.ds[i];
  });
}

template <typename Cone>
int64_t BoundedSystem<Cone>::MemoryBytes(const KnownRotationProblem& problem) {
  constexpr int64_t kPerObservation =
      sizeof(NtScaling<Cone>) + 4 * sizeof(Vector) + sizeof(Vector3d) +
      3 * sizeof(double) +      // refinement
      3 * 9 * sizeof(double) +  // A_s, A_t, Q
      2 * sizeof(int32_t);      // structure and order
  constexpr int64_t kPerUnknown = 5 * sizeof(Vector3d);
  return static_cast<int64_t>(problem.observations.size()) * kPerObservation +
         (problem.num_points + problem.num_frames) * kPerUnknown +
         FrameSystem(AnchoredStructure(problem)).MemoryBytes();
}

template class BoundedSystem<SecondOrderCone>;
template class BoundedSystem<FourHalfLines>;

}  // namespace krot
