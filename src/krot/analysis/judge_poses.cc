#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "krot/analysis/epipolar.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"

namespace krot::internal {
namespace {

constexpr size_t kMinDecidedPairs = 3;  // for an image to be called wrong

// How an image's pose, and the best others, fit its matches with images that
// are not called wrong.
struct PoseFits {
  int64_t num_matches = 0;
  int64_t num_agreeing = 0;
  int64_t num_agreeing_moved = 0;
  int64_t num_agreeing_turned = 0;
  RigidTransform moved;
  RigidTransform turned;
  // By how much each change lowers the sum of squared errors, which count up to
  // the tolerance: px^2.
  double gain_moved = 0;
  double gain_turned = 0;
  // Whether the better change halves the sum, over the matches that agree with
  // it or with the pose as it is.
  bool is_misplaced = false;
  bool is_rotation_proved_wrong = false;

  double Gain() const { return std::max(gain_moved, gain_turned); }
};

class PoseJudge {
 public:
  PoseJudge(const MatchRays& rays, const Database& database,
            const std::vector<std::vector<double>>& errors_px, int num_threads,
            PairCheck* check)
      : rays_(rays),
        database_(database),
        num_threads_(num_threads),
        check_(*check),
        pairs_of_(check->images.size()),
        is_misplaced_(check->images.size(), 0),
        is_right_(check->images.size(), 0) {
    for (size_t p = 0; p < errors_px.size(); ++p) {
      sums_px2_.push_back(SumOfSquares(errors_px[p]));
      const CheckedPair& pair = check_.pairs[p];
      if (pair.state == PairState::kNotChecked) continue;
      pairs_of_[pair.image1].push_back(p);
      pairs_of_[pair.image2].push_back(p);
    }
  }

  void Run() {
    Explain();
    FindMisplaced();
    do {
      Explain();
    } while (Acquit());
    for (const int32_t i : check_.cheapest.images) {
      CheckedImage& image = check_.images[i];
      const auto num_decided =
          static_cast<size_t>(image.num_kept + image.num_contradictory);
      image.is_wrong = is_misplaced_[i] != 0 || num_decided >= kMinDecidedPairs;
    }
    std::vector<int32_t> wrong;
    std::copy_if(check_.cheapest.images.begin(), check_.cheapest.images.end(),
                 std::back_inserter(wrong),
                 [&](int32_t i) { return check_.images[i].is_wrong; });
    ForEach(wrong, [&](int32_t i) { Describe(FitsOf(i), i); });
  }

 private:
  // Finds the cheapest explanation of the contradictions between images that
  // are not misplaced. Images that were acquitted are not called wrong.
  void Explain() {
    std::vector<ContradictoryPair> contradictions;
    int64_t most = 1;
    for (const CheckedPair& pair : check_.pairs) {
      if (pair.state != PairState::kContradictory ||
          is_misplaced_[pair.image1] != 0 || is_misplaced_[pair.image2] != 0) {
        continue;
      }
      contradictions.push_back({pair.image1, pair.image2, pair.num_matches});
      most += pair.num_matches;
    }
    std::vector<int64_t> costs;
    for (size_t i = 0; i < check_.images.size(); ++i) {
      costs.push_back(is_right_[i] != 0 ? most : check_.images[i].kept_matches);
    }
    Explanations explanations = ExplainContradictions(costs, contradictions);
    check_.cheapest = std::move(explanations.cheapest);
    check_.is_cheapest_proved = explanations.is_proved;
    check_.runner_up = std::move(explanations.runner_up);
    AddMisplaced(&check_.cheapest);
    if (check_.runner_up) AddMisplaced(&*check_.runner_up);
  }

  // Misplaced images cost no matches, as theirs fit another pose.
  void AddMisplaced(Explanation* explanation) const {
    for (size_t i = 0; i < is_misplaced_.size(); ++i) {
      if (is_misplaced_[i] != 0) {
        explanation->images.push_back(static_cast<int32_t>(i));
      }
    }
    std::sort(explanation->images.begin(), explanation->images.end());
  }

  bool IsCalledWrong(int32_t image) const {
    return is_misplaced_[image] != 0 ||
           std::binary_search(check_.cheapest.images.begin(),
                              check_.cheapest.images.end(), image);
  }

  int32_t OtherOf(size_t pair, int32_t image) const {
    const CheckedPair& checked = check_.pairs[pair];
    return checked.image1 == image ? checked.image2 : checked.image1;
  }

  // The pairs of an image with right images. In other pairs the fault may be
  // the other image's.
  std::vector<size_t> Witnesses(int32_t image) const {
    std::vector<size_t> pairs;
    for (const size_t p : pairs_of_[image]) {
      if (!IsCalledWrong(OtherOf(p, image))) pairs.push_back(p);
    }
    return pairs;
  }

  // Finds images whose errors another pose halves, so that no image is judged
  // by them. Of neighbours the one that gains most comes first.
  void FindMisplaced() {
    const auto num_images = static_cast<int32_t>(check_.images.size());
    std::vector<std::optional<PoseFits>> fits(num_images);
    for (;;) {
      std::vector<int32_t> open = ImagesAboveNoise();
      open.erase(std::remove_if(open.begin(), open.end(),
                                [&](int32_t i) { return fits[i].has_value(); }),
                 open.end());
      ForEach(open, [&](int32_t i) { fits[i] = FitsOf(i); });
      const auto gain = [&](int32_t i) {
        return fits[i] && fits[i]->is_misplaced ? fits[i]->Gain() : 0;
      };
      std::vector<int32_t> misplaced;
      for (int32_t i = 0; i < num_images; ++i) {
        if (gain(i) == 0) continue;
        if (std::none_of(pairs_of_[i].begin(), pairs_of_[i].end(),
                         [&](size_t p) {
                           const int32_t other = OtherOf(p, i);
                           return std::make_pair(gain(other), i) >
                                  std::make_pair(gain(i), other);
                         })) {
          misplaced.push_back(i);
        }
      }
      if (misplaced.empty()) return;
      for (const int32_t i : misplaced) {
        is_misplaced_[i] = 1;
        fits[i].reset();
        for (const size_t p : pairs_of_[i]) fits[OtherOf(p, i)].reset();
      }
    }
  }

  // Images whose mean squared error, in pairs that do not contradict, is more
  // than twice the median image's: half of it would still be no less than
  // noise.
  std::vector<int32_t> ImagesAboveNoise() const {
    std::vector<std::pair<double, int32_t>> means;
    std::vector<double> all;
    for (size_t i = 0; i < check_.images.size(); ++i) {
      const auto image = static_cast<int32_t>(i);
      if (IsCalledWrong(image)) continue;
      double sum = 0, num_matches = 0;
      for (const size_t p : Witnesses(image)) {
        if (check_.pairs[p].state == PairState::kContradictory) continue;
        sum += sums_px2_[p];
        num_matches += static_cast<double>(check_.pairs[p].num_matches);
      }
      if (num_matches == 0) continue;
      means.emplace_back(sum / num_matches, image);
      all.push_back(sum / num_matches);
    }
    std::vector<int32_t> above;
    if (all.empty()) return above;
    const double median = Median(std::move(all));
    for (const auto& [mean, image] : means) {
      if (mean > 2 * median) above.push_back(image);
    }
    return above;
  }

  // Acquits images of the cheapest explanation: a quarter of their matches
  // agree with their poses, as in pairs that do not contradict, and no other
  // pose fits clearly better. Returns whether there are any.
  bool Acquit() {
    std::vector<int32_t> called;
    for (const int32_t i : check_.cheapest.images) {
      if (is_misplaced_[i] == 0 && check_.images[i].num_kept > 0) {
        called.push_back(i);
      }
    }
    std::vector<char> is_right(check_.images.size(), 0);
    ForEach(called, [&](int32_t i) {
      const PoseFits fits = FitsOf(i);
      is_right[i] = fits.num_agreeing > 0 && !fits.is_misplaced &&
                    4 * fits.num_agreeing >= fits.num_matches;
    });
    bool is_any = false;
    for (const int32_t i : called) {
      if (is_right[i] == 0) continue;
      is_right_[i] = 1;
      is_any = true;
    }
    return is_any;
  }

  double SumOfSquares(const std::vector<double>& errors_px) const {
    double sum = 0;
    for (const double error : errors_px) sum += Square(error);
    return sum;
  }

  double Square(double error_px) const {
    const double bounded = std::min(error_px, check_.tolerance_px);
    return bounded * bounded;
  }

  // Fits all matches from `start`, and then those that agree with the result,
  // so that the others do not bend it.
  RigidTransform Fit(const std::vector<WitnessMatch>& matches,
                     const RigidTransform& start, PoseChange change,
                     std::vector<double>* errors_px) const {
    RigidTransform pose =
        FitEpipolarPose(matches, start, change, check_.noise_px);
    *errors_px = EpipolarErrors(matches, pose);
    std::vector<WitnessMatch> agreeing;
    for (size_t k = 0; k < matches.size(); ++k) {
      if ((*errors_px)[k] <= check_.tolerance_px) {
        agreeing.push_back(matches[k]);
      }
    }
    const RigidTransform other =
        FitEpipolarPose(agreeing, pose, change, check_.noise_px);
    std::vector<double> other_px = EpipolarErrors(matches, other);
    if (SumOfSquares(other_px) < SumOfSquares(*errors_px)) {
      pose = other;
      *errors_px = std::move(other_px);
    }
    return pose;
  }

  PoseFits FitsOf(int32_t i) const {
    std::vector<WitnessMatch> matches;
    std::vector<size_t> begin;  // by witness
    NearestPoint to_baselines;
    const std::vector<size_t> witnesses = Witnesses(i);
    int64_t num_matches = 0;
    for (const size_t p : witnesses) num_matches += check_.pairs[p].num_matches;
    matches.reserve(num_matches);
    for (const size_t p : witnesses) {
      const CheckedPair& checked = check_.pairs[p];
      const bool is_first = checked.image1 == i;
      const int32_t other = OtherOf(p, i);
      const Eigen::Vector3d center =
          Center(rays_.geometries[other].cam_from_world);
      if (checked.state == PairState::kContradictory) {
        to_baselines.Add(center, checked.best_baseline,
                         static_cast<double>(checked.num_explained));
      }
      begin.push_back(matches.size());
      for (const auto& match : database_.pairs[p].matches) {
        auto rays = rays_.Of(database_.pairs[p], match);
        if (!rays) continue;
        if (!is_first) std::swap(rays->first, rays->second);
        matches.push_back(
            {rays->first, rays_.World(rays->second, other), center});
      }
    }
    PoseFits fits;
    begin.push_back(matches.size());
    fits.num_matches = static_cast<int64_t>(matches.size());
    const RigidTransform& as_it_is = rays_.geometries[i].cam_from_world;
    const std::vector<double> errors = EpipolarErrors(matches, as_it_is);
    std::vector<double> moved, turned;
    // A move starts where the image is, and where the best baselines meet:
    // there may be another minimum, far off.
    fits.moved = Fit(matches, as_it_is, PoseChange::kMove, &moved);
    if (const auto met = to_baselines.Solve()) {
      std::vector<double> other;
      const RigidTransform pose =
          Fit(matches, {as_it_is.rotation, -as_it_is.rotation * *met},
              PoseChange::kMove, &other);
      if (SumOfSquares(other) < SumOfSquares(moved)) {
        fits.moved = pose;
        moved = std::move(other);
      }
    }
    fits.turned = Fit(matches, as_it_is, PoseChange::kTurn, &turned);
    // Only pairs count of which half of the matches agree after a turn, so that
    // these are right, not wrong matches.
    int64_t most_explained = 0, contradictory = 0;
    for (size_t w = 0; w < witnesses.size(); ++w) {
      const CheckedPair& checked = check_.pairs[witnesses[w]];
      if (checked.state != PairState::kContradictory) continue;
      const int64_t num_agreeing = NumAgreeing(
          {turned.begin() + begin[w], turned.begin() + begin[w + 1]});
      if (2 * num_agreeing < checked.num_matches) continue;
      most_explained += checked.most_explained;
      contradictory += checked.num_matches;
    }
    fits.is_rotation_proved_wrong = 4 * most_explained < contradictory;
    fits.num_agreeing = NumAgreeing(errors);
    fits.num_agreeing_moved = NumAgreeing(moved);
    fits.num_agreeing_turned = NumAgreeing(turned);
    const double sum = SumOfSquares(errors);
    fits.gain_moved = sum - SumOfSquares(moved);
    fits.gain_turned = sum - SumOfSquares(turned);
    const std::vector<double>& better =
        fits.gain_moved > fits.gain_turned ? moved : turned;
    double sum_of_agreeing = 0;
    for (size_t k = 0; k < matches.size(); ++k) {
      if (std::min(errors[k], better[k]) <= check_.tolerance_px) {
        sum_of_agreeing += Square(errors[k]);
      }
    }
    fits.is_misplaced = witnesses.size() >= kMinDecidedPairs &&
                        fits.Gain() > 0 && 2 * fits.Gain() >= sum_of_agreeing;
    return fits;
  }

  int64_t NumAgreeing(const std::vector<double>& errors_px) const {
    return std::count_if(errors_px.begin(), errors_px.end(), [&](double error) {
      return error <= check_.tolerance_px;
    });
  }

  void Describe(const PoseFits& fits, int32_t i) {
    const RigidTransform& as_it_is = rays_.geometries[i].cam_from_world;
    CheckedImage& image = check_.images[i];
    image.num_matches = fits.num_matches;
    image.num_agreeing_moved = fits.num_agreeing_moved;
    image.num_agreeing_turned = fits.num_agreeing_turned;
    image.is_rotation_proved_wrong = fits.is_rotation_proved_wrong;
    image.moved_cam_from_world = fits.moved;
    image.moved_by = (Center(fits.moved) - Center(as_it_is)).norm();
    image.turned_by_deg =
        std::abs(Eigen::AngleAxisd(fits.turned.rotation *
                                   as_it_is.rotation.transpose())
                     .angle()) *
        kDegreesPerRadian;
    image.fault = FaultOf(fits);
  }

  static PoseFault FaultOf(const PoseFits& fits) {
    if (2 * fits.num_agreeing_moved >= fits.num_matches &&
        fits.gain_moved > fits.gain_turned) {
      return PoseFault::kPosition;
    }
    if ((2 * fits.num_agreeing_turned >= fits.num_matches &&
         fits.gain_turned > fits.gain_moved) ||
        fits.is_rotation_proved_wrong) {
      return PoseFault::kRotation;
    }
    return PoseFault::kUnclear;
  }

  template <typename Body>
  void ForEach(const std::vector<int32_t>& images, const Body& body) const {
    ParallelForEach(
        static_cast<int64_t>(images.size()), num_threads_,
        [&](int64_t n) { body(images[n]); }, /*chunk_size=*/1);
  }

  const MatchRays& rays_;
  const Database& database_;
  const int num_threads_;
  PairCheck& check_;
  std::vector<double> sums_px2_;               // of each pair
  std::vector<std::vector<size_t>> pairs_of_;  // of each image: checked pairs
  std::vector<char> is_misplaced_;             // images
  std::vector<char> is_right_;                 // images that were acquitted
};

}  // namespace

void JudgePoses(const MatchRays& rays, const Database& database,
                const std::vector<std::vector<double>>& errors_px,
                int num_threads, PairCheck* check) {
  PoseJudge(rays, database, errors_px, num_threads, check).Run();
}

}  // namespace krot::internal
