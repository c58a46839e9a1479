#include "krot/adjust/optimality.h"

#include <ceres/crs_matrix.h>

namespace krot {

std::optional<SquaredErrors> EvaluateErrors(int num_threads,
                                            ceres::Problem* problem) {
  ceres::Problem::EvaluateOptions options;
  options.apply_loss_function = false;
  options.num_threads = num_threads;
  SquaredErrors errors;
  std::vector<double> residuals;
  if (!problem->Evaluate(options, &errors.cost, &residuals, nullptr, nullptr)) {
    return std::nullopt;
  }
  errors.values.reserve(residuals.size() / 2);
  for (size_t i = 0; i + 1 < residuals.size(); i += 2) {
    errors.values.push_back(residuals[i] * residuals[i] +
                            residuals[i + 1] * residuals[i + 1]);
  }
  return errors;
}

std::optional<double> Stationarity(int num_threads, ceres::Problem* problem) {
  ceres::Problem::EvaluateOptions options;
  options.num_threads = num_threads;
  double cost = 0;
  std::vector<double> gradient;
  ceres::CRSMatrix jacobian;
  if (!problem->Evaluate(options, &cost, nullptr, &gradient, &jacobian)) {
    return std::nullopt;
  }
  if (cost <= 0) return 0.0;
  std::vector<double> diagonal(gradient.size(), 0.0);
  for (size_t i = 0; i < jacobian.values.size(); ++i) {
    diagonal[jacobian.cols[i]] += jacobian.values[i] * jacobian.values[i];
  }
  double sum = 0;
  for (size_t j = 0; j < gradient.size(); ++j) {
    if (diagonal[j] > 0) sum += gradient[j] * gradient[j] / diagonal[j];
  }
  return sum / (2 * cost);
}

}  // namespace krot
