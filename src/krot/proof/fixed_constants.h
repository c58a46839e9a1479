#pragma once

#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// What x_cam = R_cw s + R_sr t + t_sr has of constants where frames or points
// are fixed, with the world's origin O moved to one of these positions: the
// centre of the first view of the first fixed frame, or else the first fixed
// point. Forces that balance wherever something moves have the same sum of
// constants from every origin (docs/method/positions.md, "What is fixed"), and
// from this one they vanish where all that is fixed coincides. The frame at the
// origin counts like one that moves.
class FixedConstants {
 public:
  using Real = long double;
  using Vector3 = Eigen::Matrix<Real, 3, 1>;

  // A part of x_cam, and the sum of absolute values that its error is in
  // proportion to.
  struct Part {
    Vector3 x_cam = Vector3::Zero();
    Real size = 0;
  };

  // Keeps a reference to the problem.
  explicit FixedConstants(const KnownRotationProblem& problem);

  const Vector3& origin() const { return origin_; }  // O
  Real origin_size() const { return origin_size_; }

  // Whether OfFrame, and not the place of its views in it, is all there is.
  bool IsAwayFromOrigin(int32_t frame) const {
    return problem_.IsFixedFrame(frame) && frame != origin_frame_;
  }
  // R_sr t_f + t_sr + R_cw O; requires that the view's frame is fixed.
  Part OfFrame(const View& view) const;
  // R_cw (s_k - O); nothing if the point moves.
  Part OfPoint(const View& view, int32_t point) const;

 private:
  const KnownRotationProblem& problem_;
  int32_t origin_frame_ = -1;
  Vector3 origin_ = Vector3::Zero();
  Real origin_size_ = 0;
};

}  // namespace krot
