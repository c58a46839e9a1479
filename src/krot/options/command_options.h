#pragma once

#include <string>

#include "krot/options/option_table.h"
#include "krot/outliers/filter_steps.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/tolerance/tolerance_analysis.h"

namespace krot::internal {

// The options that `solver` and `point_triangulator` share, in their groups
// Solver, FastDescent and Problem.
void AddSolveOptions(SolveModelOptions* options, Context* context,
                     OptionTable* table);

// Problem.same_image, which `outlier_filter` has as well.
void AddSameImage(BuildProblemOptions* options, OptionTable* table);

// Throws OptionError for pairs of options that contradict each other. To be
// called once they are set.
void CheckSolveOptions(const SolveModelOptions& options,
                       const OptionTable& table);

// What follows the lowest maximum, of `solver` alone: Solver.finish and its
// like, Solver.polish.
void AddFinishOptions(SolveModelOptions* options, OptionTable* table);

// Solver.finish_loss and its scale alone.
void AddFinishLoss(SolveModelOptions* options, OptionTable* table);
void CheckFinishLoss(const SolveModelOptions& options,
                     const OptionTable& table);

// Throws OptionError for those that would have no effect. To be called after
// they are set.
void CheckFinishOptions(const SolveModelOptions& options,
                        const OptionTable& table);

// The options of `solver`, without its paths.
void AddSolverOptions(TolerantSolveOptions* options, Context* context,
                      OptionTable* table);

// Defaults that depend on others. Throws OptionError for pairs of options that
// contradict each other, or have no effect. To be called once they are set.
void ResolveSolverOptions(const OptionTable& table, SolveModelOptions* options);

// The options of `outlier_filter`, without its paths.
void AddOutlierFilterOptions(OutlierFilterOptions* options, Context* context,
                             OptionTable* table);

// To be called after they are set: the method where none is given, which is
// conflicts with a bound or if something is asked for that needs them. Throws
// OptionError for options that would have no effect, or lack another.
void ResolveOutlierFilterOptions(const OptionTable& table, bool makes_profile,
                                 OutlierFilterOptions* options);

// What the options of `tolerance_analyzer` say before there is a model.
struct ToleranceArguments {
  ToleranceOptions options;  // without what the lists name
  // Separated by commas; "" if not given.
  std::string images;
  std::string points;
  std::string gauge_images;
};

// The options of `tolerance_analyzer`, without its paths.
void AddToleranceOptions(ToleranceArguments* arguments, Context* context,
                         OptionTable* table);

// With what the lists name of the model: images by name or, where none has such
// a name, by id; all images if neither images nor points are named. Throws
// OptionError for what the model does not have.
ToleranceOptions ResolveToleranceOptions(const ToleranceArguments& arguments,
                                         const Model& model);

// The options of `bundle_adjuster`, under COLMAP 4's names, and under 3.8's.
class AdjustmentOptions {
 public:
  void AddTo(OptionTable* table);

  // What they say. Throws OptionError for pairs that contradict each other. To
  // be called once they are set.
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
