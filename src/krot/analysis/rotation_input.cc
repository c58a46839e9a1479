#include "krot/analysis/rotation_input.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/context.h"
#include "krot/model.h"

namespace krot::internal {
namespace {

// A model speaks against rotations if half of its observations fit with its
// own, to this share of the image's larger side.
constexpr double kFits = 0.01;
// A wrong convention multiplies errors by far more than this.
constexpr double kFarSmaller = 5;

std::optional<double> FiniteMedian(std::vector<double> errors) {
  if (errors.empty()) return std::nullopt;
  for (double& error : errors) {
    if (std::isnan(error)) error = std::numeric_limits<double>::infinity();
  }
  const double median = Median(std::move(errors));
  return std::isfinite(median) ? std::optional<double>(median) : std::nullopt;
}

// Leaves those that differ, if any do: those of the images that were turned.
void KeepChanged(std::vector<double>* before, std::vector<double>* after) {
  size_t num_kept = 0;
  for (size_t n = 0; n < before->size(); ++n) {
    const double was = (*before)[n];
    const double is = (*after)[n];
    if (was == is || (std::isnan(was) && std::isnan(is))) continue;
    (*before)[num_kept] = was;
    (*after)[num_kept++] = is;
  }
  if (num_kept == 0) return;
  before->resize(num_kept);
  after->resize(num_kept);
}

double LargestSide(const Model& model) {
  uint64_t side = 0;
  for (const Camera& camera : model.cameras) {
    side = std::max({side, camera.width, camera.height});
  }
  return static_cast<double>(side);
}

std::string Pixels(const std::optional<double>& error) {
  std::ostringstream text;
  if (error) text << std::fixed << std::setprecision(2) << *error << " px";
  return error ? text.str() : "infinite, behind the cameras";
}

}  // namespace

RotationInput TakeRotations(const FileBytes& file, Model* model,
                            int num_threads, const FileNote& note) {
  RotationInput input;
  std::vector<double> before = PixelErrors(*model, num_threads);
  input.replaced = ReplaceRotations(file, model, note);
  std::vector<double> after = PixelErrors(*model, num_threads);
  KeepChanged(&before, &after);
  input.median_error_before = FiniteMedian(std::move(before));
  input.median_error_after = FiniteMedian(std::move(after));
  const bool model_fits =
      input.median_error_before &&
      *input.median_error_before <= kFits * LargestSide(*model);
  if (input.replaced.mistake.empty() || !model_fits) return input;
  const bool is_far_worse =
      !input.median_error_after ||
      kFarSmaller * *input.median_error_before < *input.median_error_after;
  if (is_far_worse) {
    throw ModelError(file.path + ": " + input.replaced.mistake +
                     "; the median error is " +
                     Pixels(input.median_error_before) +
                     " with the model's own, with these " +
                     Pixels(input.median_error_after));
  }
  return input;
}

}  // namespace krot::internal
