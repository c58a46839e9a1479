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

// Finds images and observations that are wrong: they contradict each other by
// more than noise or, with a database, its verified matches contradict the
// poses. Not seen: wrong matches that agree with the model, as those of
// duplicate structures.

// ---- Noise ----

// How noisy a model's observations are, and which of them are wrong, because
// noise does not explain them: data snooping [Baarda 1968].
//
// The cameras stay, and every point is moved to the least squares of its track.
// There an observation's error is e = R (noise), with R = I - A (A'A)^-1 A' and
// A the derivatives of the track's pixels by the point: in a track of two it is
// a half, in one of twenty nearly all. To be comparable, each is standardised:
//
//   w^2 = e_i' (sigma^2 R_ii)^-1 e_i,
//
// which is chi^2 with two degrees of freedom for Gaussian noise of standard
// deviation sigma per axis. A direction in which R_ii is nearly 0 shows
// nothing: it is left out and called uncontrolled, which does not mean sound.
// Cameras are taken to be exact, which makes w a little too small.

struct NoiseOptions {
  // The probability that a model with Gaussian noise alone has an observation
  // above the critical value; in (0, 1).
  double false_alarm = 0.05;
  // The standard deviation of every observation's noise, relative to sigma, by
  // track element; > 0. Empty: it is the same for all.
  std::vector<double> relative_sigmas;
  // Observations to ignore, by track element. Empty: none.
  std::vector<char> is_left_out = {};
  // Standard deviation of the noise per axis, pixels; > 0. None: estimated.
  std::optional<double> sigma_px = {};
};

// With the point at the least squares of its track.
struct ObservationNoise {
  Eigen::Vector2d error_px = Eigen::Vector2d::Zero();  // projected - measured
  // The eigenvalues of R_ii, ascending, in [0, 1]: the share of the noise's
  // variance that shows in the least and in the most controlled direction.
  std::array<double, 2> redundancy = {0, 0};
  // How many directions are controlled (eigenvalue of at least kControlled): 2;
  // 1 in a track of two or where all rays are in a plane; or 0.
  int num_controlled = 0;
  double relative_sigma = 1;  // NoiseOptions::relative_sigmas
  // The standardised error over the controlled directions; if only one is, the
  // w of two that is exceeded with the same probability. Infinite if the point
  // is not in front of the camera or is in it, nearer than a billionth of the
  // median camera's distance from the middle of the cameras; NaN if none is.
  double w = 0;
};

// A direction is uncontrolled if it shows less than a hundredth of its variance
// [Foerstner, Wrobel, Photogrammetric Computer Vision, 2016, Sec. 4.6].
inline constexpr double kControlled = 0.01;

struct ModelNoise {
  std::vector<ObservationNoise> observations;  // as Model::track_elements
  std::vector<Eigen::Vector3d> points;         // as Model::points3D

  // Standard deviation of the noise per axis, pixels, such that the median of
  // w^2 is that of chi^2. None if nothing is controlled.
  std::optional<double> sigma_px;
  // Of a chi^2 that is spread as sigma^2 is, which the median determines.
  double degrees_of_freedom = 0;
  // The scale of a Cauchy loss for tails that are heavier than Gaussian: with
  // it the loss is the likelihood of a Student's t distribution with the 50 %
  // and 90 % quantiles of the errors. None if the tails are not heavier.
  std::optional<double> cauchy_scale_px;
  // Noise alone exceeds this w with probability false_alarm / num_tested.
  double critical_w = 0;
  int64_t num_tested = 0;  // observations with a controlled direction
  int64_t num_above = 0;   // w > critical_w
};

// Estimates the noise of a model and the w of every observation. Requires a
// valid model (ValidateModel). Throws std::invalid_argument for options out of
// range. The same bits at any number of threads. O(observations), some
// microseconds each.
ModelNoise EstimateNoise(const Model& model, const NoiseOptions& options = {},
                         const Context& context = {});

// ---- Conventions ----

// How poses are written, if not as COLMAP does it. The default is COLMAP's own
// way: cam_from_world with w first, camera axes x right, y down, z forward.
struct PoseConventions {
  bool has_w_last = false;         // quaternions are x, y, z, w
  bool is_world_from_cam = false;  // rotations take camera to world
  bool has_centers = false;        // translations are the cameras' centres
  bool is_left_handed = false;     // the axes of world and cameras are
  // Takes the file's camera axes to COLMAP's; if they are left-handed, once
  // their y has been turned round.
  Eigen::Matrix3d cam_from_file_axes = Eigen::Matrix3d::Identity();

  // All that are tried, COLMAP's own first.
  static std::vector<PoseConventions> All();

  // How many things differ from COLMAP's: the order of quaternions, the
  // direction, the axes.
  int NumDifferences() const;
};

// One map along the photo's axes that takes the pixels at which cameras see the
// model's points to where some images have them.
struct PixelMap {
  std::vector<int32_t> images;  // in Model::images, ascending
  std::vector<std::string> image_names;
  // Their cameras with the intrinsics that their images ask for. Empty if other
  // images of these cameras fit, or no intrinsics explain the map: then the 2D
  // points are those of other photos.
  std::vector<Camera> cameras;
  // The image's pixel of a camera's (x, y, 1).
  Eigen::Matrix<double, 2, 3> image_from_camera;
};

// How a model's numbers differ from COLMAP's, as another program writes them
// otherwise, or as some are those of other photos.
struct Conventions {
  PoseConventions poses;  // of images; in rigs, those of frames
  // Of the other sensors in a rig, which is their world; it has the file's
  // camera axes, too.
  PoseConventions sensors;
  // What translations of sensors must be multiplied by, as rigs are written in
  // another unit than the world.
  double rig_factor = 1;
  // What focal lengths, principal points and image sizes must be multiplied by:
  // they are those of photos of another size.
  double intrinsics_factor = 1;
  bool has_central_principal_point = false;  // though the file says otherwise
  // Takes the axes of the file's 2D points, which may count from another corner
  // or rows first, to COLMAP's.
  Eigen::Matrix2d pixel_from_file_axes = Eigen::Matrix2d::Identity();
  bool has_wrong_points = false;  // 3D points: not where their images see them
  // Where cameras or 2D points are wrong, and poses and 3D points are right.
  std::vector<PixelMap> pixel_maps;

  // Median reprojection errors of a sample of the model's tracks, pixels: as it
  // stands, and so converted, with points where their images see them; in the
  // images of sensors or pixels, if only these differ. No error counts more
  // than the size of the photo.
  double median_error_as_read_px = 0;
  double median_error_px = 0;

  // All axes of 2D points that are tried, COLMAP's first.
  static std::vector<Eigen::Matrix2d> AllPixelAxes();

  // How many things differ from COLMAP's; points are another matter.
  int NumDifferences() const;

  // A pose of an image or a frame, one of a sensor in its rig, a camera, a 2D
  // point of a converted camera, and a 3D point in COLMAP's conventions.
  Pose ToColmap(const Pose& pose) const;
  Pose SensorToColmap(const Pose& sensor_from_rig) const;
  Camera ToColmap(const Camera& camera) const;
  Eigen::Vector2d ToColmap(const Eigen::Vector2d& pixel,
                           const Camera& camera) const;
  Eigen::Vector3d ToColmap(const Eigen::Vector3d& xyz) const;
};

// The simplest conventions under which the model's tracks, or the matches of a
// database if it has none, fit: their median error falls to a quarter or less
// of what it is as COLMAP reads the model, even with points where their images
// see them, and to a hundredth or less of the photo's size; or points alone are
// wrong, and with others it is within 4 px. Pixel maps are asked before, of
// images with more than 4 px, the bound of COLMAP's filter. None if nothing
// differs, or nothing fits. In rigs, reference sensors' images say how frames
// are written, and then all others how sensors are. Requires a valid model.
// Milliseconds for a sound model, up to a few seconds otherwise.
std::optional<Conventions> FindConventions(const Model& model,
                                           const Database* database = nullptr,
                                           const Context& context = {});

// The model in COLMAP's conventions. `from` must come from FindConventions.
Model ConvertModel(const Model& model, const Conventions& from,
                   const Context& context = {});

// ---- Verdicts ----

enum class ImageVerdict {
  kFine,
  kWeaklyHeld,  // by sound observations, ten times as weakly as the median one
  kWrong,
  kNotJudged,  // it has a pose, but no 2D points that could check it
};

// Why an image is wrong. Noise up to three times the model's is no fault,
// unless too few observations are left to tell it from kChance.
enum class ImageFault {
  kNone,
  kMatches,  // the matches of its pairs contradict its pose (CheckPairs)
  kLens,     // its own camera's focal length is odd; its errors are no noise
  kContradicted,  // noise does not explain most of its errors
  kMisplaced,     // another pose halves the sum of its squared errors
  kChance,        // its errors are those of chance matches
  kUnsupported,   // hardly any of its 2D points agrees with a 3D point
};

struct ImageCheck {
  ImageId image_id = 0;
  std::string name;
  ImageVerdict verdict = ImageVerdict::kFine;
  ImageFault fault = ImageFault::kNone;
  // kLens: its own camera's focal length and the others' median, pixels.
  double focal_length_px = 0;
  double others_focal_length_px = 0;
  int64_t num_observations = 0;  // in tracks
  // Of these: those that other observations check, and those of them that are
  // wrong. For a wrong image this is the count at the time it was called wrong.
  int64_t num_tested = 0;
  int64_t num_wrong = 0;
  // The turn and shift of its frame that its observations ask for, if the
  // other images stay and points move along.
  double turn_deg = 0;
  double shift = 0;  // scene units
  // The largest standard deviation of its frame's centre in any direction,
  // scene units, and that of its rotation. They follow from the frame's
  // observations that are not wrong; points move along, and other frames stay.
  // Infinite if these observations do not hold the frame at all.
  double center_sigma = 0;
  double turn_sigma_deg = 0;
  // center_sigma relative to the median image's; infinite likewise.
  double relative_center_sigma = 0;
};

struct WrongObservation {
  uint64_t element = 0;  // in Model::track_elements
  ImageId image_id = 0;
  std::string image_name;
  uint32_t point2D_idx = 0;
  Point3DId point3D_id = 0;
  double w = 0;  // infinite: the point is in the camera, or not before it
  // From where the rest of its track has the point; or NaN.
  double error_px = 0;
  bool is_of_two = false;  // both are listed: nothing tells which is wrong
};

// A track whose wrong observations agree on a second point.
struct TwoPointTrack {
  Point3DId point3D_id = 0;
  int64_t num_first = 0;   // observations that agree with the point
  int64_t num_second = 0;  // observations that agree with `second`
  Eigen::Vector3d second = Eigen::Vector3d::Zero();
};

// Images that too few tracks tie to the rest: as a whole, they may be
// elsewhere, turned, larger or smaller, and no error would show it.
struct ModelPart {
  std::vector<int32_t> images;  // in ModelCheck::images, ascending
  // Tracks that images of both sides see, wrong observations not counted.
  int64_t num_tracks = 0;
  // By how much noise lets the cameras be off (RMS of their standard
  // deviations) if the part moves, turns and grows as a whole, scene units, and
  // relative to the radius of all cameras (RMS). At least a thirtieth of it;
  // infinite where nothing holds the part. To first order.
  double center_sigma = 0;
  double relative_center_sigma = 0;
};

// What all images of a camera share, and what may be wrong with it.
enum class CameraFault {
  kFocalLength,
  kPrincipalPoint,
  kDistortion,
  kPlaceInRig,
  kAspectRatio,  // its model has one focal length, and its images ask for two
  kLens,         // its images ask for a distortion that its model does not have
  kSharing,      // some of its images ask for another lens than the others
  kImages,       // all of its images are wrong, three and more
};

// A camera that contradicts its images: another focal length, principal point,
// distortion or place in its rig takes at least a tenth of their squared errors
// away, all poses and points moving along; or other cameras' images contradict
// all of its own.
struct WrongCamera {
  CameraId camera_id = 0;
  CameraFault fault = CameraFault::kFocalLength;
  int64_t num_images = 0;
  // Fall of all squared errors by those of its images, to first order; [0, 1].
  double gain = 0;
  std::vector<double> focal_lengths_px;  // kFocalLength: as they are
  // Their mean, as it is and as the images ask for, pixels.
  double focal_length_px = 0;
  double asked_focal_length_px = 0;
  std::string model_name;                // kAspectRatio, kLens
  std::vector<std::string> image_names;  // kSharing: those that ask for another
  // kPrincipalPoint: by how much it is off, pixels.
  double offset_px = 0;
  // kPlaceInRig: the turn and shift that the images ask for.
  double turn_deg = 0;
  double shift = 0;  // scene units
};

struct ModelCheckOptions {
  // Read for this model (ReadDatabase); none: the model alone is judged. With
  // keypoint scales, noise is taken to grow with their square root.
  const Database* database = nullptr;
  // The probability that a model with Gaussian noise alone has a wrong
  // observation, and that a model in which some images are three times as noisy
  // as most has a wrong image; in (0, 1).
  double false_alarm = 0.05;
};

struct ModelCheck {
  // If the model is not in COLMAP's conventions, everything else here is about
  // the converted one.
  std::optional<Conventions> conventions;
  std::optional<PairCheck> pairs;  // with a database
  // Standard deviation of the noise per axis, pixels; with keypoint scales, for
  // the median scale. None if no observation is checked by another one: then
  // only matches can tell what is wrong.
  std::optional<double> sigma_px;
  // A Cauchy loss for the observations that are not wrong; none if the tails of
  // their errors are no heavier than Gaussian ones.
  std::optional<double> cauchy_scale_px;
  std::optional<double> median_scale_px;  // where keypoint scales are known
  double critical_w = 0;
  // The share of squared errors that is no noise: the correlation with that of
  // the nearest 2D point of another track, 10 px off or more, less three sigma.
  // Up to 0.33 for sound cameras in real models, 0.42 for wrongly shared ones.
  double error_correlation = 0;
  // Whether most images stand where their own errors would put them, up to half
  // an image's noise, and most points where these see them. Else adjust first.
  bool is_adjusted = true;
  // Whether sigma_px is within COLMAP's 4 px or a hundredth of the photos'
  // size. If not, nothing else that is said counts.
  bool fits = true;
  // Observations and images may look wrong only because of them: adjust the
  // model with what is wrong free, and check it again. The largest gain first.
  std::vector<WrongCamera> cameras;
  int64_t num_tested = 0;          // observations of images that are not wrong
  std::vector<ImageCheck> images;  // as Model::images
  // Wrong observations of images that are not wrong; largest w first.
  std::vector<WrongObservation> observations;
  std::vector<TwoPointTrack> tracks;
  std::vector<ModelPart> parts;  // the most images first
  // Points of an adjusted model that are far from where their observations,
  // none of which is wrong, see them: in Model::points3D.
  std::vector<int32_t> misplaced_points;
  // The same, of points at one pixel of images that turn. No camera is judged.
  std::vector<int32_t> still_points;
  // Pairs in `images` that see most of their points at the same pixels.
  std::vector<std::array<int32_t, 2>> same_photos;
  // The points' places without wrong observations, as Model::points3D.
  std::vector<Eigen::Vector3d> points;

  int64_t NumImages(ImageVerdict verdict) const;
  bool ErrorsAgree() const { return is_adjusted && error_correlation > 0.4; }
  bool IsAnythingWrong() const {
    return conventions || !fits || ErrorsAgree() || !observations.empty() ||
           !cameras.empty() || !misplaced_points.empty() ||
           !still_points.empty() || NumImages(ImageVerdict::kWrong) > 0 ||
           (pairs && pairs->IsAnythingWrong());
  }
};

// Finds what is wrong in a model (docs/method/outliers.md). A model in other
// conventions is converted to COLMAP's. Then the images go that the database's
// matches call wrong, and in each track the observation with the largest w,
// until none is critical. The image with the strongest evidence against it is
// called wrong if one of the tests of ImageFault says so; over all images of a
// sound model the probability of that is false_alarm. All this is repeated
// without the image, so that none is blamed for its neighbour. Requires a valid
// model. The same bits at any number of threads.
ModelCheck CheckModel(const Model& model, const ModelCheckOptions& options = {},
                      const Context& context = {});

struct ModelCure {
  Model model;
  std::vector<std::string> moved;  // names of the images that were moved
};

// A copy in COLMAP's conventions without wrong observations and images. An
// image whose position alone is wrong by its matches is moved to where these
// fit best (CheckedImage::moved_cam_from_world), unless it is wrong there too
// or others share its frame. All other cameras stay. Points that lose some move
// to the least squares of the rest; stored errors are updated. A bitwise copy
// if nothing is wrong. `check` must come from CheckModel with these options.
ModelCure CureModel(const Model& model, const ModelCheck& check,
                    const ModelCheckOptions& options = {},
                    const Context& context = {});

}  // namespace krot
