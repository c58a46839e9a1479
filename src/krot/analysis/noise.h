#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/check.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {

// Noise below this is that of stored numbers, pixels: keypoints are 32-bit
// floats.
inline constexpr double kLeastNoisePx = 1e-3;

// COLMAP's mapper keeps no observation with a larger error
// (Mapper.filter_max_reproj_error), pixels.
inline constexpr double kFilteredPx = 4;

// An observation that is no noise.
struct SnoopedObservation {
  uint64_t element = 0;  // in Model::track_elements
  // When it was removed; of a track of two the larger one. Infinite: the point
  // is in the camera, or not in front of it.
  double w = 0;
  // Its error where the rest of its track places the point, pixels; if nothing
  // is left, where the last two did. NaN if that is not in front of its camera.
  double error_px = 0;
  // One of two that contradict each other: which one is wrong cannot be told.
  bool is_of_two = false;
};

struct NoiseSnooping {
  ModelNoise noise;                         // of what is left
  std::vector<SnoopedObservation> removed;  // largest w first
  // Before each removal, and at last.
  std::vector<double> sigma_path_px;
  // False if sigma, by the median, fell until more than half of the
  // observations were gone. Then it is such that three quarters of the w^2 are
  // below their quantile of chi^2, after each removal or, if more than half
  // would go again, at first.
  bool has_common_noise = true;
};

// Relative to the largest eigenvalue of a sum of squares: less is rounding.
inline constexpr double kNoDirection = 1e-13;

// G with G G' = H^+.
Eigen::Matrix3d RootOfInverse(const Eigen::Matrix3d& H);

// The w of a sum of squares in so many directions, in [0, 2], each divided by
// its variance. For a single direction it is the w of two that is exceeded with
// the same probability; NaN for none.
double StandardizedError(double chi2, int num_directions);

// The critical value: noise makes the largest of so many w exceed it with the
// probability `false_alarm`. The standard deviation is itself an estimate with
// so many degrees of freedom, nu: w^2 / 2 is F distributed, and P(w^2 > x) = (1
// + x / nu)^(-nu / 2).
double CriticalW(int64_t num_tested, double false_alarm,
                 double degrees_of_freedom);

// Data snooping: of every track the observation with the largest w is removed,
// if that is above the critical value, and the track is fitted anew; then sigma
// and the critical value are measured anew, until nothing is above. The removal
// of the largest w lowers the track's sum of squares most, so that a wrong
// observation goes before the sound ones that it bends. Of a track of two both
// go. `may_be_bent`: a sigma above COLMAP's filter may come from images far
// off that bend most tracks; then the lowest decile of the errors sets it, if
// that is clearly less and most observations agree with it. Requires and throws
// what EstimateNoise does.
NoiseSnooping SnoopNoise(const Model& model, const NoiseOptions& options,
                         const Context& context, bool may_be_bent = true);

// The error of an observation that sees x_cam, in camera axes, and its
// derivatives by x_cam.
struct DifferentiatedError {
  Eigen::Vector2d error;  // pixels
  Eigen::Matrix<double, 2, 3> by_cam;
};
// None if RowAtProjection has none.
std::optional<DifferentiatedError> DifferentiateError(
    const Camera& camera, const Point2D& pixel, const Eigen::Vector3d& x_cam);

// A point nearer than this lies in its camera; scene units.
double LeastDistance(const std::vector<ImageGeometry>& geometries);

// For each track element the index of its point.
std::vector<int32_t> PointsOfElements(const Model& model);

// All tracks of a model, each fitted by itself with the cameras as they stand,
// and which of their observations take part.
class TrackNoise {
 public:
  // Keeps references. Every observation whose image has a pose takes part.
  TrackNoise(const Model& model, const std::vector<double>& relative_sigmas);

  // Moves point k to the least squares of its observations that take part and
  // see it, and fills in their noise. Different points may be fitted at the
  // same time.
  void Fit(int64_t k);

  // Complete but for w, which needs sigma, where an observation takes part and
  // sees its point. w is infinite if it does not see the point, NaN for all
  // others.
  const std::vector<ObservationNoise>& observations() const {
    return observations_;
  }
  void SetW(uint64_t e, double w) { observations_[e].w = w; }
  // w^2 sigma^2: the sum over controlled directions, squared pixels.
  double SquaredError(uint64_t e) const { return squared_errors_[e]; }

  bool TakesPart(uint64_t e) const { return takes_part_[e]; }
  void Remove(uint64_t e);

  // The error of any observation, pixels, at its point's present place; not
  // finite if it does not see that.
  Eigen::Vector2d ErrorOf(uint64_t e) const;
  // The fitted place of point k; the model's place if that is at infinity or in
  // a camera that sees it, or if the point was not fitted.
  Eigen::Vector3d Point(int64_t k) const;

 private:
  struct View {
    const Camera* camera = nullptr;  // null: without a pose
    const Image* image = nullptr;
    Eigen::Matrix3d cam_from_world_rotation;
    Eigen::Vector3d center;
  };
  // Divided by the observation's relative sigma.
  struct Row {
    Eigen::Vector2d error;
    Eigen::Matrix<double, 2, 3> J;  // by the tangent of the sphere
  };
  class Track;

  const Model& model_;
  const std::vector<double>& relative_sigmas_;
  std::vector<View> views_;    // as Model::images
  double least_distance_ = 0;  // a nearer point is in the camera; scene units
  const std::vector<int32_t> image_of_;  // by track element
  const std::vector<int32_t> point_of_;  // by track element
  std::vector<char> takes_part_;
  std::vector<ObservationNoise> observations_;
  std::vector<double> squared_errors_;
  std::vector<Eigen::Vector4d> points_;  // homogeneous
  std::vector<char> is_in_camera_;       // the fit of each point
};

// Sums over the observations of a pose, which is an image's or a frame's, in
// the directions that other poses control. The points move along and are
// eliminated: M is its diagonal block of the reduced camera system, sigma^2
// M^-1 its covariance while the other poses stay, and -M^-1 g the step that its
// errors ask for.
struct PoseSums {
  Eigen::Matrix<double, 6, 6> M =
      Eigen::Matrix<double, 6, 6>::Zero();  // F' R_ii F, R_ii as above
  Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();  // F' e
  double square = 0;           // e' R_ii^+ e
  int64_t num_directions = 0;  // in these sums
  Eigen::Matrix<double, 6, 1> step = Eigen::Matrix<double, 6, 1>::Zero();
  // The standard deviations of the centre, scene units, and of the rotation,
  // radians, for noise of one pixel, in the direction where they are largest.
  // Infinite where nothing holds them.
  double CenterSpread() const;
  double TurnSpread() const;

  // By how much the step lowers `square`, to first order.
  double Gain() const { return -g.dot(step); }
  // In [0, 1).
  double GainShare() const {
    return square > 0 ? std::min(Gain() / square, 1 - 1e-12) : 0;
  }
  // exp(-exponent) bounds the probability that noise gains as much, be it of
  // `sigma_px` or of a size of the image's own. Such a gain is sigma^2 chi^2
  // with six degrees of freedom, and its share of all squared errors, in n
  // directions, has the distribution Beta(3, (n - 6) / 2).
  double GainExponent(double sigma_px) const;
  // The share beyond that which six parameters take from noise.
  double UnexpectedGainShare() const {
    const double expected = 6 / static_cast<double>(num_directions);
    return expected < 1 ? (GainShare() - expected) / (1 - expected) : 0;
  }
};

// The general form of PoseSums::GainExponent: by freeing so many parameters
// the sum of squares `square`, over so many directions, falls by `gain`. An odd
// number of parameters is rounded up.
double GainExponent(double gain, double square, int64_t num_directions,
                    int num_parameters, double sigma_px);

// An image's squared errors up to a limit, as shares u of the limit's square.
// Gaussian noise of sigma gives u the density lambda exp(-lambda u) / (1 -
// exp(-lambda)) with lambda = limit^2 / (2 sigma^2), whatever was filtered out
// beyond the limit. Errors by chance fill the disc evenly: lambda = 0.
//
// In a track of two only the error across the epipolar line shows, and half of
// its variance: the density is that of exp(-2 lambda u) / sqrt(u), and errors
// by chance fill a segment evenly.
class ErrorsInDisc {
 public:
  // Of observations in longer tracks and in tracks of two; pixels.
  ErrorsInDisc(const std::vector<double>& errors_px,
               const std::vector<double>& errors_of_two_px, double limit_px);

  int64_t num() const { return num_in_disc_ + num_on_segment_; }
  // Of u, and of 2 u in tracks of two; at most that of chance.
  double mean() const { return mean_; }
  double lambda() const { return lambda_; }  // the likeliest one, >= 0
  // The exponent of Chernoff's bound on the probability of such a mean, or of
  // one farther from that of `other`: the divergence of all u, >= 0.
  double Exponent(double other) const;

 private:
  // If lambda is this.
  double MeanAt(double lambda) const;
  double LogFactors(double lambda) const;

  int64_t num_in_disc_ = 0, num_on_segment_ = 0;
  double mean_ = 0, lambda_ = 0;
};

// The errors of each image up to the limit to which the model was filtered:
// their 99.9 % quantile. `errors_px` as PixelErrors gives them.
std::vector<ErrorsInDisc> FillDiscs(const Model& model,
                                    const std::vector<double>& errors_px);

// ModelCheck::error_correlation of the observations that `noise` tests; 0 of
// stored numbers' noise. O(n^1.5) for the n observations of an image.
double ErrorCorrelation(const Model& model, const ModelNoise& noise);

// The exponent of Chernoff's bound exp(-exponent) on the probability that so
// many trials or more succeed, each with probability p; 0 if as many are to be
// expected.
double SuccessExponent(int64_t num_successes, int64_t num_trials, double p);

// The sums of each image, over the observations that are tested according to
// `noise`; and for each image those of its frame, whose images, if there are
// others in its rig, have one pose and control each other as one. Requires a
// valid model. O(observations), times the square of the images of a frame.
std::vector<PoseSums> AddUpImages(const Model& model, const ModelNoise& noise);
std::vector<PoseSums> AddUpFrames(const Model& model, const ModelNoise& noise);

// By image: whether it has a pose that nothing can check, as neither it has 2D
// points nor others hold its frame.
std::vector<char> HaveBarePoses(const Model& model,
                                const std::vector<ImageGeometry>& geometries);

// Whether noise is known, and tested observations have more coordinates than
// what they determine: points, and poses of frames up to a similarity.
bool HasRedundancy(const Model& model, const ModelNoise& noise);

// CheckModel of a model in COLMAP's conventions.
ModelCheck CheckConverted(const Model& model, const ModelCheckOptions& options,
                          const Context& context);

// ---- Parts ----

// What no adjustment of a model mends.
struct LastingFaults {
  // Observations whose point lies in their camera (ObservationNoise::w).
  int64_t num_in_camera = 0;
  // Sets of frames that tracks join, and the images outside the largest one.
  // Frames without tracks are in none.
  int32_t num_parts = 0;
  int64_t num_images_outside = 0;
  int64_t num_images = 0;  // in all parts
};
// Requires a valid model. O(observations).
LastingFaults FindLastingFaults(const Model& model);

// The parts of a model that too few tracks tie to the rest, the most images
// first. Tracks are those that `noise` tests, as it fits them; sigma_px must be
// known. A maximum spanning tree joins frames by the tracks that they share.
// Where cutting it gives a part of two frames or more that is not tied by many
// tracks which several frames of both sides see, ModelPart::center_sigma is
// found for it.
//
// To first order: a part moves as a whole, with its points, by a similarity
// about its centre o, so by K (t, omega, s) at x with K = (I, -[x - o]x, x -
// o). Of a track with the information H_a of the part's observations about the
// point and H_b of the others', the point eliminated,
//
//   K' H_a (H_a + H_b)^-1 H_b K
//
// is what it says about the part, and sigma^2 times the inverse of their sum is
// the covariance. Requires a valid model. O(sum of squared track lengths), and
// O(observations) for each part that is not tied by many tracks.
std::vector<ModelPart> FindLooseParts(const Model& model,
                                      const ModelNoise& noise);

}  // namespace krot::internal
