#include "krot/adjust/optimality.h"

#include <ceres/crs_matrix.h>

namespace krot {

std::optional<std::vector<double>> EvaluateResiduals(int num_threads,
                                                     ceres::Problem* problem) {
  ceres::Problem::EvaluateOptions options;
  options.apply_loss_function = false;
  options.num_threads = num_threads;
  std::vector<double> residuals;
  if (!problem->Evaluate(options, nullptr, &residuals, nullptr, nullptr)) {
    return std::nullopt;
  }
  return residuals;
}

double HalfSquaredNorm(const std::vector<double>& residuals) {
  double sum = 0;
  for (const double residual : residuals) sum += residual * residual;
  return sum / 2;
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
