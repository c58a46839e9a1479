#include "krot/options/command_options.h"

#include <functional>
#include <string>
#include <vector>

namespace krot::internal {
namespace {

constexpr char kCeres[] = "BundleAdjustmentCeres.";
constexpr char kPlain[] = "BundleAdjustment.";

// Options that COLMAP 4 and COLMAP 3 have in different groups.
const std::vector<std::string> kMoved = {
    "max_num_iterations",
    "max_linear_solver_iterations",
    "function_tolerance",
    "gradient_tolerance",
    "parameter_tolerance",
    "max_num_images_direct_dense_cpu_solver",
    "max_num_images_direct_sparse_cpu_solver"};

void RefuseBoth(const OptionTable& table, const std::string& a,
                const std::string& b) {
  if (!table.IsGiven(a) || !table.IsGiven(b)) return;
  throw OptionError("--" + a + " and --" + b + " are the same; give one");
}

}  // namespace

void AdjustmentOptions::AddTo(OptionTable* table) {
  AddRefined(table);
  AddCap(table);
  AddCeres(table);
  AddWithoutEffect(table);
}

void AdjustmentOptions::AddRefined(OptionTable* table) {
  BundleAdjustmentOptions* options = &adjustment_;
  table->AddBool("BundleAdjustment.refine_focal_length",
                 &options->refine_focal_length, "Focal lengths may move");
  table->AddBool("BundleAdjustment.refine_principal_point",
                 &options->refine_principal_point, "Principal points may move");
  table->AddBool("BundleAdjustment.refine_extra_params",
                 &options->refine_extra_params,
                 "Distortion parameters may move");
  table->AddBool("BundleAdjustment.refine_rig_from_world",
                 &options->refine_rig_from_world,
                 "Frames may move; in a model without rigs, images");
  table->AddBool("BundleAdjustment.refine_sensor_from_rig",
                 &options->refine_sensor_from_rig,
                 "The sensors of a rig may move in it");
  table->AddBool("BundleAdjustment.refine_extrinsics", &refine_extrinsics_,
                 "COLMAP 3.8's name for the last two together");
  table->AddBool("BundleAdjustment.refine_points3D", &options->refine_points3D,
                 "Points may move");
  table->AddBool("BundleAdjustment.constant_rig_from_world_rotation",
                 &options->constant_rig_from_world_rotation,
                 "Frames that may move keep their rotations");
  table->AddInteger("BundleAdjustment.min_track_length",
                    &options->min_track_length, AtLeast(1, "observations"),
                    "Leave out points with fewer usable observations; they "
                    "stay in the model");
  table->AddNamed<AdjustmentDatum>(
      "BundleAdjustment.datum", &datum_,
      {{"CAMERAS", AdjustmentDatum::kCameras},
       {"POINTS", AdjustmentDatum::kPoints},
       {"FIRST_CAMERA", AdjustmentDatum::kFirstCamera}},
      "What the report's standard deviations refer to where nothing is fixed: "
      "the cameras' mean place, turn and extent; inner constraints over the "
      "points; or the first camera and its longest base");
}

void AdjustmentOptions::AddCap(OptionTable* table) {
  table->Add({"BundleAdjustment.max_error",
              "Keep every error below this; minimum: first lower the largest "
              "error over all that moves, to a local minimum",
              "a number > 0, pixels, or minimum", "", false,
              [this](const std::string& text) {
                adjustment_.lower_max_error = text == "minimum";
                return adjustment_.lower_max_error ||
                       (ParseReal(text, &max_error_) && max_error_ > 0);
              }});
  table->Add({"BundleAdjustment.max_error_factor",
              "The same, as a multiple of the lowest maximum of krot solver",
              "a number > 1", "", false, [this](const std::string& text) {
                return ParseReal(text, &max_error_factor_) &&
                       max_error_factor_ > 1;
              }});
}

void AdjustmentOptions::AddCeres(OptionTable* table) {
  BundleAdjustmentOptions* options = &adjustment_;
  for (const std::string group : {kCeres, kPlain}) {
    const auto text = [&](size_t k, const std::string& meaning) {
      return group == kCeres ? meaning
                             : "COLMAP 3's name of " + (kCeres + kMoved[k]);
    };
    table->AddInteger(group + kMoved[0], &options->max_num_iterations,
                      AtLeast(0), text(0, "The most iterations"));
    table->AddInteger(
        group + kMoved[1], &options->max_linear_solver_iterations, AtLeast(1),
        text(1, "The most iterations of conjugate gradients in each"));
    table->AddReal(
        group + kMoved[2], &options->function_tolerance, AtLeast(0.0),
        text(2, "Stop when the cost changes by less, relative to it"));
    table->AddReal(group + kMoved[3], &options->gradient_tolerance,
                   AtLeast(0.0),
                   text(3, "Stop when no entry of the gradient is larger"));
    table->AddReal(
        group + kMoved[4], &options->parameter_tolerance, AtLeast(0.0),
        text(4, "Stop when the parameters change by less, relative to them"));
    table->AddInteger(
        group + kMoved[5], &options->max_num_images_direct_dense, AtLeast(0),
        text(5, "Up to so many images the reduced camera system is dense"));
    table->AddInteger(
        group + kMoved[6], &options->max_num_images_direct_sparse, AtLeast(0),
        text(6,
             "Up to so many images it is sparse; beyond, and where its factor "
             "is nearly full, conjugate gradients solve it"));
  }
  table->AddNamed<RobustLoss>("BundleAdjustmentCeres.loss_function_type",
                              &options->loss,
                              {{"TRIVIAL", RobustLoss::kTrivial},
                               {"SOFT_L1", RobustLoss::kSoftL1},
                               {"CAUCHY", RobustLoss::kCauchy},
                               {"HUBER", RobustLoss::kHuber}},
                              "How large errors are weighed");
  table->AddReal("BundleAdjustmentCeres.loss_function_scale",
                 &options->loss_scale, Above(0.0, "pixels"),
                 "The error above which a loss other than TRIVIAL weighs "
                 "less");
  table->AddThreads("BundleAdjustmentCeres.num_threads", &num_threads_,
                    "without a cap the last digits differ from run to run with "
                    "more than one");
}

// Accepts options that say where COLMAP computes; KROT always computes on the
// CPU, and adjusts with Ceres.
void AdjustmentOptions::AddWithoutEffect(OptionTable* table) {
  const auto add = [&](const std::string& name, const std::string& range,
                       const std::function<bool(const std::string&)>& parse) {
    table->Add({name, "", range, "", false, parse, false, {}, true});
  };
  add("BundleAdjustment.backend", "CERES: KROT adjusts with no other solver",
      [](const std::string& text) { return IsSameWord(text, "CERES"); });
  for (const std::string group : {kCeres, kPlain}) {
    add(group + "use_gpu", "0: KROT adjusts on the CPU alone",
        [](const std::string& text) {
          bool use_gpu = true;
          return ParseBool(text, &use_gpu) && !use_gpu;
        });
    for (const char* name : {"gpu_index", "min_num_images_gpu_solver",
                             "min_num_residuals_for_cpu_multi_threading",
                             "max_num_images_direct_dense_gpu_solver",
                             "max_num_images_direct_sparse_gpu_solver"}) {
      add(group + name, "", [](const std::string&) { return true; });
    }
  }
}

AdjustModelOptions AdjustmentOptions::Resolve(const OptionTable& table) const {
  for (const std::string& name : kMoved) {
    RefuseBoth(table, kCeres + name, kPlain + name);
  }
  for (const char* name : {"BundleAdjustment.refine_rig_from_world",
                           "BundleAdjustment.refine_sensor_from_rig"}) {
    RefuseBoth(table, "BundleAdjustment.refine_extrinsics", name);
  }
  RefuseBoth(table, "BundleAdjustment.max_error",
             "BundleAdjustment.max_error_factor");

  AdjustModelOptions options;
  options.datum = datum_;
  options.adjustment = adjustment_;
  BundleAdjustmentOptions& adjustment = options.adjustment;
  if (!refine_extrinsics_) {
    adjustment.refine_rig_from_world = false;
    adjustment.refine_sensor_from_rig = false;
  }
  if (!adjustment.refine_rig_from_world) {
    table.Refuse("BundleAdjustment.constant_rig_from_world_rotation",
                 "where frames may not move");
  }
  const bool is_trivial = adjustment.loss == RobustLoss::kTrivial;
  if (is_trivial) {
    table.Refuse("BundleAdjustmentCeres.loss_function_scale",
                 "without --BundleAdjustmentCeres.loss_function_type");
  }
  const bool has_cap = table.IsGiven("BundleAdjustment.max_error");
  const bool has_factor = table.IsGiven("BundleAdjustment.max_error_factor");
  if ((has_cap || has_factor) && !is_trivial) {
    throw OptionError(
        "--BundleAdjustment.max_error and max_error_factor need "
        "--BundleAdjustmentCeres.loss_function_type TRIVIAL");
  }
  if (has_cap && !adjustment.lower_max_error) {
    adjustment.max_error = max_error_;
  }
  if (has_factor) options.max_error_factor = max_error_factor_;
  return options;
}

}  // namespace krot::internal
