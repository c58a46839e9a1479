// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#include "colmap/estimators/known_rotation.h"

#include "colmap/estimators/krot_model.h"
#include "colmap/util/logging.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <fstream>
#include <future>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <krot/convert/certificate_file.h>
#include <krot/check.h>
#include <krot/outliers/outlier_filter.h>
#include <krot/report/reports.h>

namespace colmap {
namespace {

constexpr std::chrono::milliseconds kBetweenStopChecks(100);

// Runs work(context) in a thread of its own and asks meanwhile, on this one,
// whether to stop. False, with the reason logged, if it was stopped or threw.
template <typename Work>
bool RunStoppable(const int num_threads,
                  const std::function<bool()>& check_if_stopped,
                  const Work& work) {
  krot::CancelFlag cancel(false);
  krot::Context context;
  context.num_threads = num_threads;
  context.cancel = &cancel;
  context.on_note = [](const std::string& note) { LOG(INFO) << note; };
  std::future<void> done =
      std::async(std::launch::async, [&]() { work(context); });
  while (done.wait_for(kBetweenStopChecks) != std::future_status::ready) {
    if (check_if_stopped && check_if_stopped()) cancel = true;
  }
  try {
    done.get();
  } catch (const std::exception& error) {
    LOG(ERROR) << error.what();
    return false;
  }
  if (cancel) LOG(WARNING) << "Stopped; the reconstruction is as it was";
  return !cancel;
}

bool CheckNumThreads(const int num_threads) {
  CHECK_OPTION(num_threads == -1 || num_threads > 0);
  return true;
}

void LogErrors(const krot::PixelErrorStatistics& before,
               const krot::PixelErrorStatistics& after) {
  LOG(INFO) << "Largest reprojection error: " << before.max << "px before, "
            << after.max << "px after; root mean square: " << before.rms
            << "px before, " << after.rms << "px after";
}

krot::SolveInit ToKrotInit(const KnownRotationInit init) {
  return init == KnownRotationInit::FEASIBLE ? krot::SolveInit::kFeasible
                                             : krot::SolveInit::kModel;
}

krot::internal::Finish ToKrotFinish(const KnownRotationFinish finish) {
  return finish == KnownRotationFinish::NONE
             ? krot::internal::Finish::kNone
             : krot::internal::Finish::kLeastSquares;
}

// Positions from nothing may not be determined well enough.
void WarnIfUnreliable(const krot::internal::OutlierFilterSummary& summary) {
  const std::string sentence = krot::internal::UnreliableSentence(summary);
  if (!sentence.empty()) LOG(WARNING) << sentence;
}

// A solve without a new model.
bool HasResult(const krot::internal::SolveSummary& summary) {
  switch (summary.termination) {
    case krot::SolveTermination::kNothingToSolve:
      LOG(ERROR) << "No observation can be used: tracks of two and more images "
                    "with distinct centers are needed";
      return false;
    case krot::SolveTermination::kInfeasible:
    case krot::SolveTermination::kNoStart:
      LOG(ERROR) << "No positions were found that agree with the rotations and "
                    "tracks; set a max_error, so that outliers are left out";
      return false;
    default:
      return true;
  }
}

// Whether KROT serves this; the reason is logged if not.
bool CanBePositioned(const GlobalPositionerOptions& options,
                     const Reconstruction& reconstruction) {
  const char* kCure = "; set the global positioner's backend to CERES";
  if (!(options.krot_max_error >= 0) ||
      !std::isfinite(options.krot_max_error)) {
    LOG(ERROR) << "krot_max_error must be a number of pixels >= 0, and is "
               << options.krot_max_error;
    return false;
  }
  if (!options.optimize_positions || !options.optimize_points) {
    LOG(ERROR) << "KROT estimates positions and points together, and one of "
                  "optimize_positions and optimize_points is off"
               << kCure;
    return false;
  }
  std::set<camera_t> unknown_focal_lengths;
  for (const image_t image_id : reconstruction.RegImageIds()) {
    const Image& image = reconstruction.Image(image_id);
    if (!image.CameraPtr()->has_prior_focal_length) {
      unknown_focal_lengths.insert(image.CameraId());
    }
    if (image.IsRefInFrame()) continue;
    const auto& sensor_from_rig =
        reconstruction.Rig(image.FramePtr()->RigId())
            .MaybeSensorFromRig(image.CameraPtr()->SensorId());
    if (!sensor_from_rig || sensor_from_rig->translation().hasNaN()) {
      LOG(ERROR)
          << "KROT needs the positions of all cameras in their rigs, and "
             "sensor_from_rig of camera "
          << image.CameraId() << " is unknown" << kCure
          << ", or give it by the rig_configurator";
      return false;
    }
  }
  if (!unknown_focal_lengths.empty()) {
    LOG(ERROR) << "KROT takes focal lengths as known, and camera "
               << *unknown_focal_lengths.begin()
               << " has no prior focal length (cameras without: "
               << unknown_focal_lengths.size() << ")" << kCure
               << ", or run the view_graph_calibrator first";
    return false;
  }
  return true;
}

void LogImages(const krot::ModelCheck& check, const krot::ImageVerdict verdict,
               const char* what, const int max_num) {
  int num_logged = 0;
  for (const krot::ImageCheck& image : check.images) {
    if (image.verdict != verdict || num_logged == max_num) continue;
    ++num_logged;
    LOG(INFO) << what << " image " << image.image_id << " (" << image.name
              << "): " << image.num_wrong << " of " << image.num_tested
              << " checked observations are more than noise";
  }
}

}  // namespace

bool KnownRotationOptions::Check() const {
  CHECK_OPTION_GE(max_error, 0);
  CHECK_OPTION(std::isfinite(max_error));
  CHECK_OPTION_GT(relative_gap, 0);
  CHECK_OPTION(std::isfinite(relative_gap));
  return CheckNumThreads(num_threads);
}

bool OutlierFilterOptions::Check() const {
  CHECK_OPTION_GT(max_error, 0);
  CHECK_OPTION(std::isfinite(max_error));
  CHECK_OPTION(prove || conflicts_path.empty());
  return CheckNumThreads(num_threads);
}

bool ModelCheckerOptions::Check() const {
  CHECK_OPTION_GE(num_worst, 0);
  return CheckNumThreads(num_threads);
}

bool SolveKnownRotation(const KnownRotationOptions& options,
                        Reconstruction& reconstruction) {
  if (!options.Check()) return false;
  krot::internal::TolerantSolveOptions solve_options;
  solve_options.solve.init = ToKrotInit(options.init);
  solve_options.solve.joint.relative_gap = options.relative_gap;
  solve_options.solve.finish.finish = ToKrotFinish(options.finish);
  if (options.max_error > 0) solve_options.max_error = options.max_error;
  krot::internal::TolerantSolveResult result;
  if (!RunStoppable(options.num_threads, options.check_if_stopped,
                    [&](const krot::Context& context) {
                      result = krot::internal::SolveTolerantly(
                          ToKrotModel(reconstruction), solve_options, context);
                    }) ||
      !HasResult(result.summary)) {
    return false;
  }
  if (result.outliers) {
    LOG(INFO) << "Observations: "
              << krot::internal::BracketSentence(*result.outliers);
    WarnIfUnreliable(*result.outliers);
  }
  LogErrors(result.summary.pixel_error_before,
            result.summary.pixel_error_after);
  LOG(INFO) << krot::internal::VerdictSentence(result.summary);
  UpdateFromKrotModel(result.model, reconstruction);
  return true;
}

bool FilterOutliers(const OutlierFilterOptions& options,
                    Reconstruction& reconstruction) {
  if (!options.Check()) return false;
  krot::internal::OutlierFilterOptions filter_options;
  filter_options.max_error = options.max_error;
  filter_options.find_conflicts = options.prove;
  krot::internal::OutlierFilterResult result;
  if (!RunStoppable(options.num_threads, options.check_if_stopped,
                    [&](const krot::Context& context) {
                      result = krot::internal::FilterOutliers(
                          ToKrotModel(reconstruction), filter_options, context);
                    })) {
    return false;
  }
  if (!options.conflicts_path.empty() && result.summary.conflicts) {
    std::ofstream file(options.conflicts_path, std::ios::binary);
    file << krot::internal::ConflictJson(*result.summary.conflicts)
         << std::flush;
    if (!file) {
      LOG(ERROR) << "Could not write " << options.conflicts_path;
      return false;
    }
  }
  LOG(INFO) << "Observations: "
            << krot::internal::BracketSentence(result.summary);
  WarnIfUnreliable(result.summary);
  LogErrors(result.summary.pixel_error_before,
            result.summary.pixel_error_after);
  UpdateFromKrotModel(result.model, reconstruction);
  return true;
}

ModelCheckerSummary CheckReconstruction(const ModelCheckerOptions& options,
                                        Reconstruction& reconstruction) {
  ModelCheckerSummary summary;
  if (!options.Check()) return summary;
  krot::internal::CheckReport report;
  krot::Model model;
  krot::Model cured;
  if (!RunStoppable(options.num_threads, nullptr,
                    [&](const krot::Context& context) {
                      model = ToKrotModel(reconstruction);
                      report.check = krot::CheckModel(model, {}, context);
                      if (report.check.sigma_px) {
                        cured =
                            krot::CureModel(model, report.check, {}, context)
                                .model;
                      }
                    })) {
    return summary;
  }
  report.num_observations = static_cast<int64_t>(model.track_elements.size());
  const krot::ModelCheck& check = report.check;
  LOG(INFO) << krot::internal::CheckSentence(report);
  if (!check.sigma_px) return summary;
  LogImages(check, krot::ImageVerdict::kWrong, "Wrong", options.num_worst);
  LogImages(check, krot::ImageVerdict::kWeaklyHeld, "Weakly determined",
            options.num_worst);
  const size_t num_logged = std::min(check.observations.size(),
                                     static_cast<size_t>(options.num_worst));
  for (size_t n = 0; n < num_logged; ++n) {
    const krot::WrongObservation& wrong = check.observations[n];
    LOG(INFO) << "Wrong observation: 2D point " << wrong.point2D_idx
              << " of image " << wrong.image_id << " (" << wrong.image_name
              << "), 3D point " << wrong.point3D_id;
  }
  summary.is_checked = true;
  summary.num_wrong_images =
      static_cast<int>(check.NumImages(krot::ImageVerdict::kWrong));
  summary.num_weak_images =
      static_cast<int>(check.NumImages(krot::ImageVerdict::kWeaklyHeld));
  summary.num_wrong_observations = static_cast<int>(check.observations.size());
  UpdateFromKrotModel(cured, reconstruction);
  return summary;
}

bool RunKnownRotationPositioning(const GlobalPositionerOptions& options,
                                 Reconstruction& reconstruction) {
  if (!CanBePositioned(options, reconstruction)) return false;
  krot::internal::OutlierFilterOptions filter_options;
  filter_options.solve.init = krot::SolveInit::kFeasible;
  filter_options.find_conflicts = false;
  filter_options.solve.find_lowest = false;  // A bundle adjustment follows.
  if (options.krot_max_error > 0) {
    filter_options.max_error = options.krot_max_error;
  }
  krot::internal::OutlierFilterResult result;
  if (!RunStoppable(
          options.solver_options.num_threads, options.check_if_stopped,
          [&](const krot::Context& context) {
            result = krot::internal::FilterOutliers(
                ToKrotModel(reconstruction, options.min_num_view_per_track),
                filter_options, context);
          })) {
    return false;
  }
  if (result.model.track_elements.empty()) {
    LOG(ERROR) << "No positions were found that agree with the rotations and "
                  "tracks";
    return false;
  }
  LOG(INFO) << "Observations: "
            << krot::internal::BracketSentence(result.summary)
            << "; largest reprojection error of the others: "
            << result.summary.pixel_error_after.max << "px";
  WarnIfUnreliable(result.summary);
  UpdateFromKrotModel(result.model, reconstruction);
  return true;
}

}  // namespace colmap
