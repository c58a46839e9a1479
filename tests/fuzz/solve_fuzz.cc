// Valid models whose structure is changed, and what solver, filter and adjuster
// make of them: a valid model whose largest error has not risen, and a bound
// that is not above it; also where they are interrupted.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "krot/context.h"
#include "krot/model.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/pipeline/solve_model.h"
#include "tests/fuzz/fuzz.h"

namespace krot::internal {
namespace {

constexpr double kRounding = 1e-6;  // relative
// Of one model: with more, hardly any is valid.
constexpr int kMaxChanges = 8;
// Of the joint solver, in each of up to 30 rounds: a matter of seconds under
// sanitizers.
constexpr int kMaxIterations = 20;
// With wild lenses proofs take minutes under sanitizers.
constexpr std::chrono::seconds kPatience(2);

// Interrupts what outlasts it.
class Deadline {
 public:
  Deadline() : thread_([this] { Wait(); }) {}
  ~Deadline() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      is_over_ = true;
    }
    ended_.notify_one();
    thread_.join();
  }
  Context context() const {
    Context context;
    context.num_threads = 1;
    context.cancel = &cancel_;
    return context;
  }

 private:
  void Wait() {
    std::unique_lock<std::mutex> lock(mutex_);
    if (!ended_.wait_for(lock, kPatience, [this] { return is_over_; })) {
      cancel_ = true;
    }
  }

  CancelFlag cancel_{false};
  std::mutex mutex_;
  std::condition_variable ended_;
  bool is_over_ = false;
  std::thread thread_;  // last: it uses all others
};

template <typename T>
T& Pick(std::vector<T>* records, ByteSource* source) {
  return (*records)[source->Byte() % records->size()];
}

// A number that does harm: any, a small change, or a power of ten.
double Number(double old, ByteSource* source) {
  switch (source->Byte() % 4) {
    case 0:
      return source->Take<double>();
    case 1:
      return old + static_cast<int8_t>(source->Byte()) / 64.0;
    case 2:
      return old * std::pow(10, static_cast<int8_t>(source->Byte()) / 8);
    default:
      return static_cast<int8_t>(source->Byte());
  }
}

void Change(Model* model, ByteSource* source) {
  if (model->track_elements.empty()) return;
  Image& image = Pick(&model->images, source);
  Frame& frame = Pick(&model->frames, source);
  Point3D& point = Pick(&model->points3D, source);
  Camera& camera = Pick(&model->cameras, source);
  const int axis = source->Byte() % 3;
  const auto change = [&](double* value) { *value = Number(*value, source); };
  switch (source->Byte() % 11) {
    case 0:
      change(&point.xyz[axis]);
      break;
    case 1:
      change(&frame.rig_from_world.translation[axis]);
      break;
    case 2:
      change(&frame.rig_from_world.quaternion_wxyz[axis]);
      break;
    case 3:
      change(&camera.params[axis % camera.params.size()]);
      break;
    case 4:
      if (!image.points2D.empty()) {
        Point2D& pixel = Pick(&image.points2D, source);
        change(axis == 0 ? &pixel.x : &pixel.y);
      }
      break;
    case 5:
      point.xyz = Pick(&model->points3D, source).xyz;
      break;
    case 6:  // two frames in one place
      frame.rig_from_world = Pick(&model->frames, source).rig_from_world;
      break;
    case 7: {  // an observation of another image, or twice
      TrackElement& element = Pick(&model->track_elements, source);
      element = Pick(&model->track_elements, source);
      break;
    }
    case 8: {  // a track is cut, its rest goes to the next
      Point3D& last = model->points3D.back();
      if (&last != &point && point.track_end > point.track_begin) {
        Point3D& next = *(&point + 1);
        --point.track_end;
        --next.track_begin;
      }
      break;
    }
    case 9: {
      Rig& rig = Pick(&model->rigs, source);
      if (!rig.sensors.empty() && rig.sensors[0].sensor_from_rig) {
        change(&rig.sensors[0].sensor_from_rig->translation[axis]);
      }
      break;
    }
    default:
      for (Point2D& pixel : image.points2D) pixel.x = std::round(pixel.x);
      break;
  }
}

double Largest(const PixelErrorStatistics& errors) { return errors.max; }

void Solve(const Model& model, uint8_t kind, const Context& context) {
  SolveModelOptions options;
  options.res_int.max_sweeps = 5;
  options.joint.max_iterations = kMaxIterations;
  if (kind & 1) options.init = SolveInit::kFeasible;
  if (kind & 2) options.finish.finish = Finish::kNone;
  const SolveModelResult result = SolveModel(model, options, context);
  ValidateModel(result.model);
  const SolveSummary& summary = result.summary;
  // Of what is infeasible there is a bound, and no cost.
  if (summary.lower_bound && std::isfinite(summary.cost_final) &&
      summary.termination != SolveTermination::kInfeasible) {
    Require(*summary.lower_bound <= summary.cost_final * (1 + kRounding),
            "no bound above the cost");
  }
  const PixelErrorStatistics& before = summary.pixel_error_before;
  const PixelErrorStatistics& after = summary.pixel_error_after;
  Require(after.not_finite <= before.not_finite,
          "no error that was finite is lost");
  Require(before.not_finite > 0 ||
              Largest(after) <= Largest(before) * (1 + kRounding),
          "no larger error");
}

void Run(ByteSource source) {
  static const Model valid = FuzzScene().model;
  const uint8_t kind = source.Byte();
  Model model = valid;
  for (int n = 0; n < kMaxChanges && !source.IsEmpty(); ++n) {
    Change(&model, &source);
  }
  try {
    ValidateModel(model);
  } catch (const ModelError&) {
    return;
  }
  const Deadline deadline;
  const Context context = deadline.context();
  switch (kind % 4) {
    case 0: {
      OutlierFilterOptions options;
      options.max_error = 2;
      // With wild lenses a proof in pixels may take a second.
      options.find_conflicts = (kind & 4) != 0;
      options.solve.joint.max_iterations = kMaxIterations;
      const OutlierFilterResult result =
          FilterOutliers(model, options, context);
      ValidateModel(result.model);
      Require(context.IsCancelled() ||
                  result.summary.num_proved <=
                      static_cast<int64_t>(result.summary.removed.size()),
              "not more proved than removed");
      break;
    }
    case 1: {
      AdjustModelOptions options;
      options.adjustment.max_num_iterations = 5;
      if (kind & 16) options.adjustment.max_error = 50;
      try {
        ValidateModel(AdjustModel(model, options, context).model);
      } catch (const ModelError&) {
      }
      break;
    }
    default:
      Solve(model, kind / 4, context);
      break;
  }
}

}  // namespace
}  // namespace krot::internal

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  krot::internal::Run({data, size});
  return 0;
}
