#pragma once

#include <optional>
#include <string>

#include "krot/options/option_table.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/tolerance/tolerance_analysis.h"

namespace krot::internal {

// The options that `solver` and `point_triangulator` share, in their groups
// Solver, FastDescent and Problem.
void AddSolveOptions(SolveModelOptions* options, Context* context,
                     OptionTable* table);

// A number of pixels > 0, if it is given.
void AddPixels(const std::string& name, const std::string& help,
               const std::string& default_text, std::optional<double>* pixels,
               OptionTable* table);

// Problem.same_image, which `outlier_filter` has, too.
void AddSameImage(BuildProblemOptions* options, OptionTable* table);

// Throws OptionError for options that would have no effect. Must be called
// after they are set.
void CheckSolveOptions(const SolveModelOptions& options,
                       const OptionTable& table);

// The options of `solver` for what follows the lowest maximum: Solver.finish
// with its parameters, and Solver.polish.
void AddFinishOptions(SolveModelOptions* options, OptionTable* table);

// Solver.finish_loss and its scale.
void AddFinishLoss(SolveModelOptions* options, OptionTable* table);
void CheckFinishLoss(const SolveModelOptions& options,
                     const OptionTable& table);

// Throws OptionError for finish options that would have no effect. Must be
// called after they are set.
void CheckFinishOptions(const SolveModelOptions& options,
                        const OptionTable& table);

// The options of `solver`, without its paths.
void AddSolverOptions(TolerantSolveOptions* options, Context* context,
                      OptionTable* table);

// Sets the defaults that depend on other options. Throws OptionError for pairs
// of options that contradict each other, and for options without effect. Must
// be called after they are set.
void ResolveSolverOptions(const OptionTable& table, SolveModelOptions* options);

// The options of `outlier_filter`, without its paths.
void AddOutlierFilterOptions(OutlierFilterOptions* options, Context* context,
                             OptionTable* table);

// Must be called after the options are set. Chooses the method if none is
// given: conflicts if there is a bound or a profile is asked for, otherwise
// snooping, without a proof of how many must go. Throws OptionError for options
// that would have no effect, or need another one.
void ResolveOutlierFilterOptions(const OptionTable& table, bool makes_profile,
                                 OutlierFilterOptions* options);

// The options of `tolerance_analyzer` as they are known before a model is read.
struct ToleranceArguments {
  // Without the images and points that the lists name.
  ToleranceOptions options;
  // Lists separated by commas; "" if not given.
  std::string images;
  std::string points;
  std::string gauge_images;
};

// The options of `tolerance_analyzer`, without its paths.
void AddToleranceOptions(ToleranceArguments* arguments, Context* context,
                         OptionTable* table);

// Finds the images and points that the lists name: images by name or, if none
// has this name, by id. All images if neither images nor points are named.
// Throws OptionError for what the model does not have.
ToleranceOptions ResolveToleranceOptions(const ToleranceArguments& arguments,
                                         const Model& model);

// The options of `bundle_adjuster`, under COLMAP 4's names, and under 3.8's.
class AdjustmentOptions {
 public:
  void AddTo(OptionTable* table);

  // The values of the options. Throws OptionError for pairs that contradict
  // each other. Must be called after they are set.
  AdjustModelOptions Resolve(const OptionTable& table) const;
  int num_threads() const { return num_threads_; }

 private:
  void AddRefined(OptionTable* table);
  void AddCeres(OptionTable* table);
  void AddWithoutEffect(OptionTable* table);
  void AddCap(OptionTable* table);

  BundleAdjustmentOptions adjustment_;
  int num_threads_ = -1;
  bool refine_extrinsics_ = true;
  double max_error_ = 0;
  double max_error_factor_ = 0;
  AdjustmentDatum datum_ = AdjustmentDatum::kCameras;
};

}  // namespace krot::internal
