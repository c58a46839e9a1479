#include "krot/outliers/outlier_filter.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>
#include <string>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "krot/analysis/noise.h"
#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/convert/reprojection.h"
#include "krot/model/derived_models.h"
#include "krot/outliers/parts.h"
#include "krot/outliers/removal.h"
#include "krot/outliers/robust_start.h"
#include "krot/pipeline/stages.h"
#include "krot/problem/gauge.h"

namespace krot::internal {
namespace {

constexpr int kNumLevels = 6;  // about, below the first

class Profiler {
 public:
  Profiler(const Model& model, const BuiltProblem& built,
           const ErrorProfileOptions& options, const Context& context)
      : model_(model),
        built_(built),
        options_(options),
        context_(context),
        search_(model, built, options.norm, context) {
    profile_.noise = FindNoiseLimit(model, built, options.norm, context);
  }

  ErrorProfile Run() {
    const auto at_level = [this](int n) {
      return context_.Within("error profile, level " + std::to_string(n) +
                             " of about " + std::to_string(kNumLevels));
    };
    profile_.levels.push_back(Solve({{}, built_.start}, at_level(0)));
    const double first = profile_.levels[0].max_error;
    const double noise = profile_.noise.max_error;
    const bool has_outliers = profile_.levels[0].lower_bound > noise;
    const double last = options_.max_error.value_or(
        has_outliers ? std::min(noise, first / 2) : first / 2);
    for (int n = 0; !context_.IsCancelled(); ++n) {
      const double now = profile_.levels.back().max_error;
      if (!(now > last) || !std::isfinite(now)) break;
      const double steps = std::max(1, kNumLevels - n);
      double bound = std::max(last, now * std::pow(last / now, 1 / steps));
      if (noise < now) bound = std::max(bound, noise);
      // A few programmes are enough where the last level's weights are at hand.
      ProfileLevel level =
          Solve(search_.Find(bound, /*max_programmes=*/n == 0 ? 4 : 2),
                at_level(n + 1));
      if (context_.IsCancelled() || !(level.max_error < now)) break;
      Charge(&level);
      Append(std::move(level));
    }
    for (size_t n = 1; has_outliers && n < profile_.levels.size(); ++n) {
      if (profile_.levels[n].max_error > noise) continue;
      profile_.elbow = n;
      break;
    }
    return std::move(profile_);
  }

 private:
  // The optimum of what a removal leaves.
  ProfileLevel Solve(Removal removal, const Context& context) const {
    OptimumWithout optimum =
        SolveWithout(model_, built_, removal.observations, removal.estimate,
                     options_.norm, context);
    ProfileLevel level;
    level.removal = std::move(removal);
    level.removal.estimate = std::move(optimum.estimate);
    level.max_error = optimum.max_error;
    level.lower_bound = optimum.lower_bound;
    level.proof = std::move(optimum.proof);
    return level;
  }

  void Charge(ProfileLevel* level) {
    if (level->removal.observations.size() <= 50) {
      profile_.conflicts =
          PackAgainstRemoval(model_, built_, {options_.norm, level->max_error},
                             level->removal, std::move(profile_.conflicts),
                             context_)
              .conflicts;
    }
    level->num_proved = static_cast<int64_t>(profile_.conflicts.size());
  }

  // Appends a level; earlier ones that removed no fewer observations are
  // dropped.
  void Append(ProfileLevel level) {
    std::vector<ProfileLevel>& levels = profile_.levels;
    while (levels.size() > 1 && levels.back().removal.observations.size() >=
                                    level.removal.observations.size()) {
      levels.pop_back();
    }
    levels.push_back(std::move(level));
  }

  const Model& model_;
  const BuiltProblem& built_;
  const ErrorProfileOptions& options_;
  const Context& context_;
  RemovalSearch search_;
  ErrorProfile profile_;
};

NoiseLimit LimitOf(const Model& model, Norm norm, const Context& context) {
  NoiseLimit limit;
  limit.max_error = kLeastNoisePx;
  const ModelNoise noise = SnoopNoise(model, {}, context).noise;
  if (!noise.sigma_px) return limit;
  limit.sigma = *noise.sigma_px;
  // ||e||_1 <= sqrt(2) ||e||_2.
  const double factor = norm.p == 1 ? std::sqrt(2.0) : 1;
  const auto count = static_cast<double>(noise.num_tested);
  limit.max_error =
      std::max(kLeastNoisePx,
               factor * limit.sigma * std::sqrt(2 * std::log(count / 0.05)));
  return limit;
}

// LimitOf for positions that fit more than half of the observations. Where most
// tracks have a wrong one, their least squares fit none, and sigma would be
// that of wrong ones: then gross errors go first.
NoiseLimit LimitOfFitting(const Model& model, Norm norm,
                          const Context& context) {
  const NoiseLimit limit = LimitOf(model, norm, context);
  const std::vector<double> errors = PixelErrors(model, context.num_threads);
  std::vector<double> of_noise;  // as if no point had been fitted
  for (const Point3D& point : model.points3D) {
    const uint64_t begin = point.track_begin, end = point.track_end;
    const auto rows = 2 * static_cast<double>(end - begin);
    if (rows < 4) continue;
    for (uint64_t e = begin; e < end; ++e) {
      // The point of a pair may take up either error.
      const double error =
          rows > 4
              ? errors[e]
              : std::hypot(errors[begin], errors[begin + 1]) / std::sqrt(2);
      of_noise.push_back(error * std::sqrt(rows / (rows - 3)));
    }
  }
  if (of_noise.empty()) return limit;
  const double gross = 10 * Median(std::move(of_noise));
  if (!(limit.sigma > gross)) return limit;
  std::vector<char> is_gross;
  for (const double error : errors) is_gross.push_back(!(error <= gross));
  return LimitOf(RemoveObservations(model, is_gross).model, norm, context);
}

}  // namespace

NoiseLimit FindNoiseLimit(const Model& model, const BuiltProblem& built,
                          Norm norm, const Context& context) {
  const NoiseLimit own = LimitOf(model, norm, context);
  context.Stage("measuring the noise");
  Estimate robust = FindRobustStart(
      built.problem, norm, std::min(kLevelOfStart, own.max_error), context);
  const NoiseLimit limit =
      LimitOfFitting(ApplyEstimate(model, built, robust), norm, context);
  const bool is_lower = limit.sigma > 0 && !(limit.sigma >= own.sigma);
  return is_lower || own.sigma == 0 ? limit : own;
}

ErrorProfile FindErrorProfile(const Model& model, const BuiltProblem& built,
                              const ErrorProfileOptions& options,
                              const Context& context) {
  CheckArgument(!options.max_error || *options.max_error > 0, "max_error",
                options.max_error.value_or(0), "> 0");
  return Profiler(model, built, options, context).Run();
}

namespace {

std::string Pixels(double value) {
  std::ostringstream words;
  words.precision(3);
  words << value << " px";
  return words.str();
}

// Starts from nothing; errors above `level` count as wrong.
void PlaceFromTracks(Norm norm, double level, const Context& context,
                     RemovalStart* start) {
  start->init = SolveInit::kFeasible;
  const KnownRotationProblem& problem = start->built.problem;
  start->built.start = FindRobustStart(problem, norm, level, context);
  context.Note("positions from rotations and tracks: the median error is " +
               Pixels(MedianError(problem, start->built.start, norm)));
}

// Whether the model has positions at which noise explains half of its errors
// and none is gross.
bool FitsItsPositions(const Model& model, const OutlierFilterOptions& options,
                      const Context& context, double explained) {
  BuildProblemOptions build = options.solve.problem;
  build.num_threads = context.num_threads;
  const BuiltProblem own = BuildProblem(model, build);
  const Norm norm = options.solve.norm;
  return HasOwnStart(own) &&
         MedianError(own.problem, own.start, norm) <= explained &&
         Reprojection(model, own)
                 .TrueCost(own.start, norm, context.num_threads) <=
             options.solve.init_max_error;
}

}  // namespace

RemovalStart FindRemovalStart(const Model& model,
                              const OutlierFilterOptions& options,
                              const Context& context) {
  BuildProblemOptions build = options.solve.problem;
  build.num_threads = context.num_threads;
  build.ignore_translations = options.solve.init == SolveInit::kFeasible;
  RemovalStart start;
  start.max_error = options.max_error.value_or(0);
  start.built = BuildProblem(model, build);
  if (!build.ignore_translations && !HasOwnStart(start.built)) {
    build.ignore_translations = true;
    start.built = BuildProblem(model, build);
  }
  const Norm norm = options.solve.norm;
  if (build.ignore_translations) {
    const double level = options.max_error.value_or(kLevelOfStart);
    PlaceFromTracks(norm, std::min(kLevelOfStart, level), context, &start);
  }
  if (start.init == SolveInit::kFeasible && !options.max_error &&
      !options.make_profile) {
    const NoiseLimit noise = LimitOfFitting(
        ApplyEstimate(model, start.built, start.built.start), norm, context);
    start.max_error = noise.max_error;
    const double largest =
        Reprojection(model, start.built)
            .TrueCost(start.built.start, norm, context.num_threads);
    // A start's errors are larger than the lowest maximum, so that these do not
    // show that an observation has to go.
    start.nearly_fits = largest <= 3 * start.max_error;
    start.fits_its_positions =
        !options.has_other_rotations &&
        FitsItsPositions(model, options, context, start.max_error);
    using Spared = OutlierFilterOptions::Spared;
    if (options.spared == Spared::kEverything ||
        (options.spared == Spared::kWhatFitsItsPositions &&
         start.fits_its_positions)) {
      return start;
    }
    context.Note("leaving out what noise of " + Pixels(noise.sigma) +
                 " per axis does not explain: errors above " +
                 Pixels(start.max_error) + "; the others may rise to " +
                 Pixels(kRoomOfFinish * start.max_error));
  }
  if (options.has_start_from_nothing) start.init = SolveInit::kFeasible;
  return start;
}

namespace {
using Eigen::Vector3d;

// What FindTurnAtOneCentre tries: directions of points, and turns of frames.
class OneCentre {
 public:
  OneCentre(const KnownRotationProblem& problem, const Estimate& estimate,
            const Context& context)
      : problem_(problem),
        context_(context),
        turns_(problem.num_frames, Eigen::Matrix3d::Identity()),
        directions_(problem.num_points),
        at_estimate_(SquaredErrorsAt(problem, estimate)),
        excess_(problem.num_points),
        squared_(problem.observations.size(), 0) {
    const double num_of_frames = 3.0 * problem.num_frames;
    const double num_free = 2.0 * static_cast<double>(squared_.size()) -
                            3.0 * problem.num_points - num_of_frames;
    if (!(num_free > 0) || HasBaseline(problem)) return;
    variance_ =
        (1 + num_of_frames / num_free) *
        std::pow(NoiseOf(problem, estimate, [](int64_t) { return true; }), 2);
    limit_ = 2 * variance_ * (problem.num_points + num_of_frames);
  }

  std::optional<double> Run() {
    if (!(limit_ > 0)) return std::nullopt;
    double excess = FindDirections();
    while (excess > limit_ && !context_.IsCancelled()) {
      const double before = excess;
      TurnFrames();
      excess = FindDirections();
      // A hundred more steps like this one would not do.
      if (!(before - excess > 0.01 * (excess - limit_))) return std::nullopt;
    }
    if (!(excess <= limit_)) return std::nullopt;
    double largest = 0;
    for (const Eigen::Matrix3d& turn : turns_) {
      largest = std::max(largest, Eigen::AngleAxisd(turn).angle());
    }
    if (largest > kLikelyTurn) return std::nullopt;
    return largest * kDegreesPerRadian;
  }

 private:
  ViewedPoint Seen(int64_t i) const {
    const Observation& o = problem_.observations[i];
    const View& view = problem_.views[o.view];
    AffineMap camera = AffineMap::Zero();
    camera.leftCols<3>() =
        view.cam_from_world_rotation * turns_[view.frame].transpose();
    return ViewPoint(camera, o, directions_[o.point]);
  }
  double WeightOf(int64_t i) const {
    return std::pow(scale2_ / (scale2_ + squared_[i]), 2);
  }

  // Every point takes the mean of its rays as they are turned. Returns by how
  // much its squared errors exceed the estimate's, in all.
  double FindDirections() {
    ParallelForEach(problem_.num_points, context_.num_threads, [&](int64_t k) {
      Vector3d sum = Vector3d::Zero();
      for (const int64_t i : problem_.OfPoint(k)) {
        sum += WeightOf(i) *
               (turns_[problem_.FrameOf(i)] * DirectionOf(problem_, i));
      }
      directions_[k] = sum.normalized();
      double sum_excess = 0, largest = 0;
      for (const int64_t i : problem_.OfPoint(k)) {
        squared_[i] = std::pow(ResidualOf(Seen(i), Norm::L2()), 2);
        sum_excess += squared_[i] - at_estimate_[i];
        largest = std::max(largest, squared_[i] - at_estimate_[i]);
      }
      // A wrong observation may agree by chance, at some distance: it counts
      // for no more than this, and so does a pair.
      const double most = kCutOff * variance_;
      const int64_t length =
          problem_.point_begin[k + 1] - problem_.point_begin[k];
      excess_[k] = length == 2 ? std::min(sum_excess, most)
                               : sum_excess - std::max(0.0, largest - most);
    });
    scale2_ = std::max(16 * variance_, 4 * Median(squared_));
    return std::accumulate(excess_.begin(), excess_.end(), 0.0);
  }

  // Turns every frame to fit the directions. T' = exp([a]) T has
  // T'^T u = T^T (u + u x a), to first order.
  void TurnFrames() {
    ParallelForEach(problem_.num_frames, context_.num_threads, [&](int64_t f) {
      Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
      Vector3d g = Vector3d::Zero();
      for (const int32_t i : problem_.OfFrame(f)) {
        if (!std::isfinite(squared_[i])) continue;
        const Observation& o = problem_.observations[i];
        const ViewedPoint seen = Seen(i);
        const Eigen::Vector2d r = seen.v / seen.depth;
        const Eigen::Matrix<double, 2, 3> by_ray =
            (o.E.bottomRows<2>() - r * o.E.row(0)) / seen.depth *
            problem_.views[o.view].cam_from_world_rotation *
            turns_[f].transpose();
        const auto J = by_ray.rowwise().cross(directions_[o.point].transpose());
        H += WeightOf(i) * J.transpose() * J;
        g += WeightOf(i) * J.transpose() * r;
      }
      const Vector3d a = -(H.ldlt().solve(g));
      if (!a.allFinite() || a.isZero(0)) return;
      turns_[f] = Eigen::AngleAxisd(a.norm(), a.normalized()) * turns_[f];
    });
  }

  const KnownRotationProblem& problem_;
  const Context& context_;
  std::vector<Eigen::Matrix3d> turns_;  // of frames, in the world
  std::vector<Vector3d> directions_;    // of points, in the world
  std::vector<double> at_estimate_;     // squared errors there
  std::vector<double> excess_;          // of points, above these
  std::vector<double> squared_;         // errors at one centre
  double scale2_ = 1;    // c^2 of MinimizeRobustly, whose weights these are
  double variance_ = 0;  // of the noise, per axis
  double limit_ = 0;     // of an excess by noise; 0: it cannot be told
};

}  // namespace

std::optional<double> FindTurnAtOneCentre(const KnownRotationProblem& problem,
                                          const Estimate& estimate,
                                          const Context& context) {
  return OneCentre(problem, estimate, context).Run();
}

}  // namespace krot::internal
