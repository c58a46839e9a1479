#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/convert/reprojection.h"
#include "krot/pipeline/solve_model.h"
#include "krot/problem/gauge.h"
#include "krot/problem/subset.h"

namespace krot::internal {

inline constexpr double kNoLevel = kInfinity;

inline constexpr int kBisections = 50;

// The largest share in [0, 1] of a way for which `is_good` holds, by bisection.
// Assumes that it holds at 0.
template <typename IsGood>
double LargestShare(const IsGood& is_good) {
  if (is_good(1.0)) return 1;
  double good = 0;
  double bad = 1;
  for (int n = 0; n < kBisections; ++n) {
    const double middle = 0.5 * (good + bad);
    (is_good(middle) ? good : bad) = middle;
  }
  return good;
}

// The steps of SettleEstimate: the noise is measured, then every frame is moved
// with all else fixed, then every point.
class Settling {
 public:
  Settling(const Model& model, const BuiltProblem& built,
           const SettleOptions& options, const Context& context,
           Estimate* estimate)
      : model_(model),
        built_(built),
        problem_(built.problem),
        options_(options),
        context_(context),
        reprojection_(model, built),
        input_(OwnEstimate(model, built)),
        components_(FindComponents(built.problem, context)),
        frames_(DescribeFrames(built.problem, context)),
        estimate_(*estimate),
        is_loose_frame_(problem_.num_frames, 0),
        is_held_frame_(problem_.num_frames, 1),
        is_loose_point_(problem_.num_points, 0),
        has_moved_point_(problem_.num_points, 0) {
    Measure();
  }

  void SettleFrames();
  void SettlePoints();
  LooseParts Describe() const;

 private:
  // For each frame, the sum over its observations on all ranks, from `zero` on.
  template <typename Sum, typename AddTo>
  std::vector<Sum> SumsOf(const std::vector<int32_t>& frames, const Sum& zero,
                          const AddTo& add_to) const;
  void Measure();
  double Squared(int64_t i, double level) const;
  std::vector<double> TypicalDistances() const;
  Eigen::Vector3d CentreOf(int32_t frame, const Estimate& estimate) const {
    return frames_[frame].world_from_rig *
           (frames_[frame].centre_in_rig - estimate.translations[frame]);
  }
  void Shift(int32_t frame, const Eigen::Vector3d& by) {
    estimate_.translations[frame] -=
        frames_[frame].world_from_rig.transpose() * by;
  }
  std::vector<int32_t> FramesThatMove() const;
  std::vector<double> LimitsOf(const std::vector<int32_t>& frames) const;
  std::vector<char> AreAsGood(const std::vector<int32_t>& frames,
                              const std::vector<Eigen::Vector3d>& shifts,
                              const std::vector<double>& limits, double level);
  Eigen::Vector3d FromFrame(int64_t i) const;
  std::vector<Eigen::Vector3d> MeanRays(
      const std::vector<int32_t>& frames) const;
  void FindLooseFrames();
  void MoveLooseFrame(int32_t f, double distance);
  bool IsAsGood(int32_t k, const Eigen::Vector3d& position, double limit,
                double level);
  void SettlePoint(int32_t k, double distance);

  const Model& model_;
  const BuiltProblem& built_;
  const KnownRotationProblem& problem_;
  const SettleOptions& options_;
  const Context& context_;
  const Reprojection reprojection_;
  const Estimate input_;
  const Components components_;
  const std::vector<FrameGeometry> frames_;
  Estimate& estimate_;
  double level_ = 0;             // the largest error, pixels
  double as_good_ = 0;           // a rise that noise explains, pixels^2
  std::vector<double> squared_;  // errors of the observations, pixels^2
  std::vector<char> is_loose_frame_;
  std::vector<char> is_held_frame_;
  std::vector<char> is_loose_point_;
  std::vector<char> has_moved_point_;
  bool has_moved_frame_ = false;
};

template <typename Sum, typename AddTo>
std::vector<Sum> Settling::SumsOf(const std::vector<int32_t>& frames,
                                  const Sum& zero, const AddTo& add_to) const {
  std::vector<Sum> sums(frames.size(), zero);
  InTurnOfRanks(
      context_,
      [&](std::vector<Sum>* of_whole) {
        ParallelFor(static_cast<int64_t>(frames.size()), /*chunk_size=*/1,
                    context_.num_threads, [&](int64_t n, int64_t, int) {
                      for (const int32_t i : problem_.OfFrame(frames[n])) {
                        add_to(i, n, &(*of_whole)[n]);
                      }
                    });
      },
      &sums);
  return sums;
}

}  // namespace krot::internal
