#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/model/model.h"

namespace krot {

// How noisy a model's observations are, and which of them are no noise: data
// snooping [Baarda 1968].
//
// With the cameras as they stand, every point is moved to the least squares of
// its track. What is left of an observation's error there is e = R (noise),
// with R = I - A (A'A)^-1 A', A the derivatives of the track's pixels by the
// point. An observation in a track of two shows a half of its error, one in a
// track of twenty nearly all of it. So errors are compared after
//
//   w^2 = e_i' (sigma^2 R_ii)^-1 e_i,
//
// which is chi^2 with two degrees of freedom for Gaussian noise of standard
// deviation sigma per axis. Directions in which R_ii is nearly 0 show nothing:
// they are left out, and said to be uncontrolled, not sound. Cameras are seen
// by hundreds of observations, so that they are taken for known; what that
// neglects makes w a little smaller.

struct NoiseOptions {
  // The probability that a model of Gaussian noise has an observation above the
  // critical value; in (0, 1).
  double false_alarm = 0.05;
  // The standard deviation of every observation's noise, relative to sigma, by
  // track element, as that of keypoints grows with their scale; > 0. Empty: all
  // have the same.
  std::vector<double> relative_sigmas;
  // By track element, which ones have no say. Empty: all have.
  std::vector<char> is_left_out = {};
  // Pixels; > 0. None: it is measured.
  std::optional<double> sigma_px = {};
};

// An observation at the least squares of its track.
struct ObservationNoise {
  Eigen::Vector2d error_px = Eigen::Vector2d::Zero();  // projected - measured
  // The eigenvalues of R_ii, ascending, in [0, 1]: the share of its variance
  // that shows, in the direction where that is least and where it is most.
  std::array<double, 2> redundancy = {0, 0};
  // How many of these are large enough (kControlled): 2, or 1 in a track of two
  // or where the rays are in a plane, or 0.
  int num_controlled = 0;
  // The square root of the sum over the controlled directions; of a single one
  // the w of two that is exceeded with the same probability. Infinite if the
  // point is not in front of the camera, NaN if nothing is controlled.
  double w = 0;
};

// A direction that shows less than a hundredth of its variance is uncontrolled
// [Foerstner, Wrobel, Photogrammetric Computer Vision, 2016, Sec. 4.6].
inline constexpr double kControlled = 0.01;

struct ModelNoise {
  std::vector<ObservationNoise> observations;  // as Model::track_elements
  std::vector<Eigen::Vector3d> points;         // as Model::points3D

  // Of an axis, pixels: the median of w^2 is that of chi^2. None if nothing is
  // controlled.
  std::optional<double> sigma_px;
  // Of sigma^2: those of a chi^2 that is spread as the median is.
  double degrees_of_freedom = 0;
  // The scale of the Cauchy loss that suits tails heavier than Gaussian ones:
  // with it the loss is the likelihood of a Student's t with their 50 % and 90
  // % quantiles. None if they are not heavier.
  std::optional<double> cauchy_scale_px;
  // w is above this with probability false_alarm / num_tested.
  double critical_w = 0;
  int64_t num_tested = 0;  // with a direction that is controlled
  int64_t num_above = 0;   // w > critical_w
};

// Requires a valid model (ValidateModel). Throws std::invalid_argument for
// options out of range. The same bits at any number of threads.
// O(observations), some microseconds each.
ModelNoise EstimateNoise(const Model& model, const NoiseOptions& options,
                         const Context& context);

// An observation that is no noise.
struct SnoopedObservation {
  uint64_t element = 0;  // in Model::track_elements
  // As it was removed, of two the larger one; infinite: not in front.
  double w = 0;
  // Where the rest of its track leads to, pixels; where nothing is left, where
  // its last two did. NaN if that is not in front of its camera.
  double error_px = 0;
  // One of two that contradict each other: which is wrong cannot be told.
  bool is_of_two = false;
};

struct NoiseSnooping {
  ModelNoise noise;                         // of what is left
  std::vector<SnoopedObservation> removed;  // largest w first
  std::vector<double> sigma_path_px;        // before each removal, and at last
  // Whether sigma stayed as it was at first: taken anew it fell until more than
  // half of the observations were gone, as it does where their noise has no
  // sigma in common.
  bool is_sigma_kept = false;
};

// Of every track the observation with the largest w is removed, if that is
// above the critical value, and the track is fitted anew; then sigma and the
// critical value are taken anew, until nothing is above. The largest w is the
// removal that lowers the track's sum of squares most, so that a wrong
// observation goes before the sound ones that it bends. Of a track of two both
// go. Requires and throws as above.
NoiseSnooping SnoopNoise(const Model& model, const NoiseOptions& options,
                         const Context& context);

}  // namespace krot
