#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/context.h"
#include "krot/database.h"
#include "krot/model.h"

namespace krot {

// Which images and observations of a model are wrong: its observations
// contradict each other by more than their noise or, with a database, the
// verified matches contradict its poses. Wrong matches that agree with the
// model, as of duplicate structures, are not seen.

// ---- Noise ----

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
ModelNoise EstimateNoise(const Model& model, const NoiseOptions& options = {},
                         const Context& context = {});

// ---- Verdicts ----

enum class ImageVerdict {
  kFine,
  kWeaklyHeld,  // what is left holds it ten times as weakly as the median image
  kWrong,
};

// Why an image is wrong. Noise three times the model's, as of a blurred photo,
// is none of them, unless too few observations are left to tell it from
// kChance.
enum class ImageFault {
  kNone,
  kMatches,  // the matches of its pairs contradict its pose (CheckPairs)
  // The focal length of its own camera stands out among those of others of the
  // kind, and so many of its observations are more than noise.
  kLens,
  kContradicted,  // most of its observations are more than noise
  kMisplaced,     // another pose halves the sum of its squared errors
  kChance,        // its errors are those of chance matches
  kUnsupported,   // hardly any of its 2D points agrees with a 3D point
};

struct ImageCheck {
  ImageId image_id = 0;
  std::string name;
  ImageVerdict verdict = ImageVerdict::kFine;
  ImageFault fault = ImageFault::kNone;
  // kLens: of its own camera and of the others' (the median), pixels.
  double focal_length_px = 0;
  double others_focal_length_px = 0;
  int64_t num_observations = 0;  // in tracks
  // Of these, that others check, and that are more than noise: of an image that
  // is not wrong, without those that are.
  int64_t num_tested = 0;
  int64_t num_wrong = 0;
  // What its observations would turn and shift it by, other images as they
  // stand; points move along.
  double turn_deg = 0;
  double shift = 0;  // scene units
  // The standard deviation of its centre in the direction where that is
  // largest, scene units, and of its rotation: the observations that are not
  // wrong hold it, points move along, other images stay. Infinite if they do
  // not hold it at all.
  double center_sigma = 0;
  double turn_sigma_deg = 0;
  // center_sigma over the median image's; infinite likewise.
  double relative_center_sigma = 0;
};

struct WrongObservation {
  uint64_t element = 0;  // in Model::track_elements
  ImageId image_id = 0;
  std::string image_name;
  uint32_t point2D_idx = 0;
  Point3DId point3D_id = 0;
  double w = 0;         // of its noise; infinite: not in front
  double error_px = 0;  // to where the rest of its track leads; or NaN
  // Of a track of two: which is wrong cannot be told.
  bool is_of_two = false;
};

// A track whose wrong observations agree on another point.
struct TwoPointTrack {
  Point3DId point3D_id = 0;
  int64_t num_first = 0;   // observations of the point
  int64_t num_second = 0;  // of the other one
  Eigen::Vector3d second = Eigen::Vector3d::Zero();
};

struct ModelCheckOptions {
  // Read for the model (ReadDatabase). None: the model alone is judged. With
  // keypoint scales the noise of an observation is taken to grow with the
  // square root of its keypoint's.
  const Database* database = nullptr;
  // The probability that a model of Gaussian noise has a wrong observation, and
  // that one whose noise is three times as large in some images as in most has
  // a wrong image; in (0, 1).
  double false_alarm = 0.05;
};

struct ModelCheck {
  std::optional<PairCheck> pairs;  // with a database
  // Of an axis, pixels; with keypoint scales, at their median. None: no
  // observation is checked by another one, as without positions or tracks, and
  // only matches can tell what is wrong.
  std::optional<double> sigma_px;
  // Of the Cauchy loss for what is left; none if its tails are no heavier than
  // Gaussian ones.
  std::optional<double> cauchy_scale_px;
  std::optional<double> median_scale_px;  // where keypoint scales are known
  double critical_w = 0;
  // Whether most images stand where their own errors would have them, to half
  // of an image's noise. Otherwise none can be called misplaced: the model is
  // to be adjusted first.
  bool is_adjusted = true;
  int64_t num_tested = 0;          // observations, of images that are not wrong
  std::vector<ImageCheck> images;  // as Model::images
  // Of images that are not wrong; largest w first.
  std::vector<WrongObservation> observations;
  std::vector<TwoPointTrack> tracks;
  // Where the points lie without what is wrong, as Model::points3D.
  std::vector<Eigen::Vector3d> points;

  int64_t NumImages(ImageVerdict verdict) const;
  bool IsAnythingWrong() const {
    return !observations.empty() || NumImages(ImageVerdict::kWrong) > 0 ||
           (pairs && pairs->IsAnythingWrong());
  }
};

// First holds the database's matches against the poses. Then, without the
// images that these call wrong, snoops (removes the observation with the
// largest w of a track, until none is above the critical value) and calls the
// image wrong that most speaks against, if one of ImageFault does with
// probability false_alarm over all images of a sound model;
// docs/method/outliers.md has the tests. Then anew without it, until there is
// none: so an image is not blamed for what its neighbour does. Requires a valid
// model. The same bits at any number of threads.
ModelCheck CheckModel(const Model& model, const ModelCheckOptions& options = {},
                      const Context& context = {});

struct ModelCure {
  Model model;
  std::vector<std::string> moved;  // names of images
};

// A copy without wrong observations and images. Images whose position alone is
// wrong, by their matches, are moved to where these fit best
// (CheckedImage::moved_cam_from_world), and are kept if nothing calls them
// wrong there; not where they share their frame with other images, which would
// move along. All other cameras stay. Points that lose observations move to the
// least squares of the others; stored errors are updated. A bitwise copy if
// nothing is wrong. `check` is CheckModel's with these options.
ModelCure CureModel(const Model& model, const ModelCheck& check,
                    const ModelCheckOptions& options = {},
                    const Context& context = {});

}  // namespace krot
