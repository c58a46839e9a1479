#include "krot/check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "krot/analysis/camera_check.h"
#include "krot/analysis/model_statistics.h"
#include "krot/analysis/noise.h"
#include "krot/base/numbers.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

constexpr double kWeaklyHeld = 10;  // x the median image's standard deviation

class Checker {
 public:
  Checker(const Model& model, const ModelCheckOptions& options,
          const Context& context)
      : model_(model),
        options_(options),
        context_(context),
        image_of_(ImagesOfElements(model)),
        in_disc_(FillDiscs(model, PixelErrors(model, context.num_threads))) {
    noise_options_.false_alarm = options.false_alarm;
    noise_options_.is_left_out.assign(image_of_.size(), 0);
    const auto odd = FindOddFocalLengths(model);
    const auto geometries = ImageGeometries(model);
    const auto is_bare = HaveBarePoses(model, geometries);
    for (size_t n = 0; n < model.images.size(); ++n) {
      ImageCheck& image = check_.images.emplace_back();
      image.image_id = model.images[n].id;
      image.name = model.images[n].name;
      if (is_bare[n]) image.verdict = ImageVerdict::kNotJudged;
      is_judged_.push_back(geometries[n].has_pose && !is_bare[n]);
      image.focal_length_px = odd[n] ? odd[n]->own : 0;
      image.others_focal_length_px = odd[n] ? odd[n]->others : 0;
    }
    for (const int32_t n : image_of_) ++check_.images[n].num_observations;
  }

  ModelCheck Run() {
    for (const Point3D& one : model_.points3D) check_.points.push_back(one.xyz);
    if (options_.database != nullptr) AskMatches();
    bool judges_cameras = true;
    for (;;) {
      // A wrong camera's images must not be taken for images far off.
      snooping_ = SnoopNoise(model_, noise_options_, context_, !judges_cameras);
      if (context_.IsCancelled() || !HasRedundancy(model_, snooping_.noise))
        return check_;
      Count();
      sums_ = AddUpFrames(model_, snooping_.noise);
      check_.is_adjusted = IsAdjusted();
      if (judges_cameras) {
        JudgeCameras();
        judges_cameras = !check_.cameras.empty();
        if (*snooping_.noise.sigma_px > kFilteredPx && !judges_cameras)
          continue;
      }
      // Images that go must not change what is taken for noise.
      if (!snooping_.has_common_noise)
        noise_options_.sigma_px = snooping_.noise.sigma_px;
      if (!CallWrong(WorstImage()) && !CallUnsupported()) break;
    }
    if (check_.NumImages(ImageVerdict::kWrong) > 0 && !judges_cameras)
      JudgeCameras();
    AddCamerasOfWrongImages(model_, &check_);
    Describe();
    FindSecondPoints();
    HowFirmly();
    return std::move(check_);
  }

 private:
  void AskMatches() {
    check_.pairs = CheckPairs(model_, *options_.database, context_);
    for (size_t n = 0; n < check_.images.size(); ++n) {
      const CheckedImage& matched = check_.pairs->images[n];
      if (matched.num_kept + matched.num_contradictory > 0)
        check_.images[n].verdict = ImageVerdict::kFine;
      if (!matched.is_wrong) continue;
      check_.images[n].fault = ImageFault::kMatches;
      CallWrong(static_cast<int32_t>(n));
    }
    // Keypoints without a scale count as median ones.
    std::vector<double> known;
    for (const std::vector<float>& scales : options_.database->scales) {
      for (const float scale : scales)
        if (scale > 0 && std::isfinite(scale)) known.push_back(scale);
    }
    if (known.empty()) return;
    check_.median_scale_px = LowerMedian(std::move(known));
    for (size_t e = 0; e < image_of_.size(); ++e) {
      const auto& scales = options_.database->scales[image_of_[e]];
      const uint32_t k = model_.track_elements[e].point2D_idx;
      const double scale = k < scales.size() ? scales[k] : 0;
      noise_options_.relative_sigmas.push_back(
          scale > 0 && std::isfinite(scale)
              ? std::sqrt(scale / *check_.median_scale_px)
              : 1);
    }
  }

  // Calls image n wrong; does nothing and returns false for -1.
  bool CallWrong(int32_t n) {
    if (n < 0) return false;
    check_.images[n].verdict = ImageVerdict::kWrong;
    for (size_t e = 0; e < image_of_.size(); ++e) {
      noise_options_.is_left_out[e] |= image_of_[e] == n;
    }
    return true;
  }

  bool IsWrong(int32_t n) const {
    return check_.images[n].verdict == ImageVerdict::kWrong;
  }

  // Counts, of images that are not wrong, what others check and contradict.
  void Count() {
    for (ImageCheck& image : check_.images) {
      if (image.verdict != ImageVerdict::kWrong) {
        image.num_tested = image.num_wrong = 0;
      }
    }
    for (const SnoopedObservation& one : snooping_.removed) {
      ImageCheck& image = check_.images[image_of_[one.element]];
      ++image.num_tested;
      ++image.num_wrong;
    }
    for (size_t e = 0; e < image_of_.size(); ++e) {
      if (snooping_.noise.observations[e].num_controlled == 0) continue;
      ++check_.images[image_of_[e]].num_tested;
    }
  }

  bool IsAdjusted() const {
    // A pose takes 0.005 of the median image's squared errors at most in
    // adjusted real models, and 0.1 to 0.2 in their minimax solutions.
    const auto gain = [&](size_t n) { return sums_[n].UnexpectedGainShare(); };
    return snooping_.noise.sigma_px.value_or(0) < kLeastNoisePx ||
           MedianOfSound(gain) < 0.1;
  }

  void JudgeCameras() {
    const ModelNoise& noise = snooping_.noise;
    check_.error_correlation = ErrorCorrelation(model_, noise);
    check_.cameras = FindWrongCameras(
        model_, noise, check_.is_adjusted, check_.ErrorsAgree(),
        options_.false_alarm, context_.num_threads);
    check_.is_adjusted = check_.is_adjusted && check_.cameras.empty();
  }

  // The image that most speaks against, -1: none; sets its fault.
  // Contradictions come before misplacements, as they bend what the others see.
  int32_t WorstImage() {
    int32_t worst = -1;
    double most = 0;
    const auto ask = [&](ImageFault fault, auto is, auto weight) {
      if (worst >= 0 && check_.images[worst].fault != fault) return;
      for (size_t n = 0; n < check_.images.size(); ++n) {
        ImageCheck& image = check_.images[n];
        if (image.verdict == ImageVerdict::kWrong || !is(n)) continue;
        if (worst >= 0 && weight(n) <= most) continue;
        if (worst >= 0) check_.images[worst].fault = ImageFault::kNone;
        image.fault = fault;
        worst = static_cast<int32_t>(n);
        most = weight(n);
      }
    };
    median_kept_ = MedianOfSound([&](size_t n) { return KeptShare(n); });
    ask(
        ImageFault::kLens,
        [&](size_t n) {
          return check_.images[n].focal_length_px > 0 &&
                 ContradictionExponent(n) > LeastExponent();
        },
        [&](size_t n) { return ContradictionExponent(n); });
    ask(
        ImageFault::kContradicted, [&](size_t n) { return IsContradicted(n); },
        [&](size_t n) {
          const ImageCheck& image = check_.images[n];
          return static_cast<double>(2 * image.num_wrong - image.num_tested);
        });
    if (check_.is_adjusted) {
      ask(
          ImageFault::kMisplaced, [&](size_t n) { return IsMisplaced(n); },
          [&](size_t n) { return sums_[n].Gain(); });
      const double lambda = LeastLambda();
      ask(
          ImageFault::kChance, [&](size_t n) { return IsChance(n, lambda); },
          [&](size_t n) { return in_disc_[n].Exponent(lambda); });
    }
    return worst;
  }

  // Calls images wrong that neither tracks nor matches hold. Those that lost
  // tracks and keep few observations bend nothing: all go at once. If there are
  // none, the most weakly held one goes of those that are contradicted more
  // than noise explains. False if nothing goes.
  bool CallUnsupported() {
    const double spread =
        MedianOfSound([&](size_t n) { return sums_[n].CenterSpread(); });
    std::vector<int32_t> few;
    int32_t weakest = -1;
    for (int32_t n = 0; n < static_cast<int32_t>(sums_.size()); ++n) {
      const ImageCheck& image = check_.images[n];
      if (IsWrong(n) || !is_judged_[n] ||
          (check_.pairs && check_.pairs->images[n].kept_matches > 0) ||
          sums_[n].CenterSpread() <= kWeaklyHeld * spread) {
        continue;
      }
      // Three observations determine a pose, and as many must check it.
      // Those that only wrong images could check speak neither way.
      if (image.num_observations - image.num_wrong < 6) {
        if (RelativeKept(n) < 1) few.push_back(n);
      } else if (ContradictionExponent(n) > LeastExponent(n) &&
                 (weakest < 0 ||
                  sums_[n].CenterSpread() > sums_[weakest].CenterSpread())) {
        weakest = n;
      }
    }
    if (few.empty() && weakest >= 0) few.push_back(weakest);
    for (const int32_t n : few) {
      check_.images[n].fault = ImageFault::kUnsupported;
      CallWrong(n);
    }
    return !few.empty();
  }

  // From this x on a bound exp(-x) on a test's probability is low enough.
  double LeastExponent() const {
    return std::log(static_cast<double>(model_.images.size()) /
                    options_.false_alarm);
  }

  // The same for an image with few of its 2D points in tracks: the fewer they
  // are, the less evidence is needed, but never less than for one image.
  double LeastExponent(size_t n) const {
    return std::max(-std::log(options_.false_alarm),
                    LeastExponent() + std::min(0.0, std::log(RelativeKept(n))));
  }

  bool IsContradicted(size_t n) const {
    const ImageCheck& image = check_.images[n];
    return 2 * image.num_wrong > image.num_tested &&
           ContradictionExponent(n) > LeastExponent(n);
  }

  // exp(-exponent) bounds the probability that three times the noise
  // contradicts so many of its observations; 0 if as many are to be expected.
  double ContradictionExponent(size_t n) const {
    const ImageCheck& image = check_.images[n];
    const double ratio = snooping_.noise.critical_w / 3;
    return SuccessExponent(image.num_wrong, image.num_tested,
                           std::exp(-ratio * ratio / 2));
  }

  // Whether another pose takes half of its squared errors away.
  bool IsMisplaced(size_t n) const {
    return sums_[n].GainShare() > 0.5 &&
           sums_[n].GainExponent(*snooping_.noise.sigma_px) > LeastExponent();
  }

  // With less, an image is noisier than the spread of the others explains.
  double LeastLambda() const {
    const auto log_lambda = [&](size_t n) {
      return std::log(
          std::max(in_disc_[n].lambda(), std::numeric_limits<double>::min()));
    };
    const double median = MedianOfSound(log_lambda);
    // In median deviations: three standard deviations of Gaussian values.
    return std::exp(median - 4.5 * MedianOfSound([&](size_t n) {
                               return std::abs(log_lambda(n) - median);
                             }));
  }

  // Whether its errors fill the disc to which the model was filtered, as evenly
  // as those of chance matches.
  bool IsChance(size_t n, double least_lambda) const {
    const ErrorsInDisc& errors = in_disc_[n];
    return errors.num() > 0 && errors.lambda() < least_lambda &&
           *snooping_.noise.sigma_px >= kLeastNoisePx &&
           errors.Exponent(least_lambda) > LeastExponent(n) &&
           errors.Exponent(0) < -std::log(options_.false_alarm);
  }

  // The share of the image's 2D points that are in tracks.
  double KeptShare(size_t n) const {
    const auto num = static_cast<double>(model_.images[n].points2D.size());
    return static_cast<double>(check_.images[n].num_observations) /
           std::max(1.0, num);
  }

  // Below 1 if that share is less than a third of the median image's.
  double RelativeKept(size_t n) const {
    return median_kept_ > 0 ? KeptShare(n) / (1.0 / 3 * median_kept_) : 1;
  }

  template <typename Value>
  double MedianOfSound(const Value& value) const {
    std::vector<double> values;
    for (size_t n = 0; n < sums_.size(); ++n) {
      if (!IsWrong(static_cast<int32_t>(n)) && sums_[n].num_directions > 0) {
        values.push_back(value(n));
      }
    }
    return values.empty() ? 0 : LowerMedian(std::move(values));
  }

  void Describe() {
    check_.sigma_px = snooping_.noise.sigma_px;
    check_.cauchy_scale_px = snooping_.noise.cauchy_scale_px;
    check_.critical_w = snooping_.noise.critical_w;
    const std::vector<int32_t> point_of = PointsOfElements(model_);
    for (const SnoopedObservation& one : snooping_.removed) {
      const TrackElement& element = model_.track_elements[one.element];
      check_.observations.push_back({one.element, element.image_id,
                                     model_.images[image_of_[one.element]].name,
                                     element.point2D_idx,
                                     model_.points3D[point_of[one.element]].id,
                                     one.w, one.error_px, one.is_of_two});
    }
    check_.points = snooping_.noise.points;
    check_.parts = FindLooseParts(model_, snooping_.noise);
  }

  // Snoops what was removed of each track by itself: does it agree on a point?
  void FindSecondPoints() {
    NoiseOptions options = noise_options_;
    options.sigma_px = check_.sigma_px;
    options.is_left_out.assign(image_of_.size(), 1);
    for (const WrongObservation& one : check_.observations) {
      options.is_left_out[one.element] = one.is_of_two || !std::isfinite(one.w);
    }
    const ModelNoise others = SnoopNoise(model_, options, context_).noise;
    for (size_t k = 0; k < model_.points3D.size(); ++k) {
      const Point3D& point = model_.points3D[k];
      TwoPointTrack track{point.id, 0, 0, others.points[k]};
      for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
        track.num_first += snooping_.noise.observations[e].num_controlled > 0;
        track.num_second += others.observations[e].num_controlled > 0;
      }
      if (track.num_first > 1 && track.num_second > 1) {
        check_.tracks.push_back(track);
      }
    }
  }

  void HowFirmly() {
    std::vector<double> sigmas;
    for (size_t n = 0; n < sums_.size(); ++n) {
      ImageCheck& image = check_.images[n];
      if (IsWrong(static_cast<int32_t>(n))) continue;
      check_.num_tested += image.num_tested;
      image.turn_deg = kDegreesPerRadian * sums_[n].step.head<3>().norm();
      image.shift = sums_[n].step.tail<3>().norm();
      image.center_sigma = *check_.sigma_px * sums_[n].CenterSpread();
      image.turn_sigma_deg =
          kDegreesPerRadian * *check_.sigma_px * sums_[n].TurnSpread();
      if (is_judged_[n]) sigmas.push_back(image.center_sigma);
    }
    if (sigmas.size() <= 2) return;  // two images: their distance is the unit
    const double median = LowerMedian(std::move(sigmas));
    for (size_t n = 0; n < sums_.size(); ++n) {
      ImageCheck& image = check_.images[n];
      if (IsWrong(static_cast<int32_t>(n))) continue;
      image.relative_center_sigma = std::isfinite(image.center_sigma)
                                        ? image.center_sigma / median
                                        : kInfinity;
      if (is_judged_[n] && !(image.relative_center_sigma <= kWeaklyHeld)) {
        image.verdict = ImageVerdict::kWeaklyHeld;
      }
    }
  }

  const Model& model_;
  const ModelCheckOptions& options_;
  const Context& context_;
  const std::vector<int32_t> image_of_;      // by track element
  std::vector<char> is_judged_;              // by image
  const std::vector<ErrorsInDisc> in_disc_;  // by image, in `model_`
  NoiseOptions noise_options_;
  NoiseSnooping snooping_;
  std::vector<PoseSums> sums_;  // as Model::images, of their frames
  double median_kept_ = 0;
  ModelCheck check_;
};

}  // namespace

ModelCheck CheckConverted(const Model& model, const ModelCheckOptions& options,
                          const Context& context) {
  return Checker(model, options, context).Run();
}

}  // namespace krot::internal
