#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/analysis/noise.h"
#include "krot/model.h"

namespace krot::internal {

// Of an image's observations, in the directions that others control. Points
// that move along are eliminated: M is its diagonal block of the reduced camera
// system, sigma^2 M^-1 its covariance while the other images stay, and -M^-1 g
// the step that its errors ask for.
struct ImageSums {
  Eigen::Matrix<double, 6, 6> M =
      Eigen::Matrix<double, 6, 6>::Zero();  // F' R_ii F, R_ii as in noise.h
  Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();  // F' e
  double square = 0;           // e' R_ii^+ e
  int64_t num_directions = 0;  // of these
  Eigen::Matrix<double, 6, 1> step = Eigen::Matrix<double, 6, 1>::Zero();

  // The standard deviations of the centre, scene units, and of the rotation,
  // radians, for noise of one pixel, in the direction where they are largest.
  // Infinite where nothing holds them.
  double CenterSpread() const;
  double TurnSpread() const;

  // What the step takes away of `square`, to first order.
  double Gain() const { return -g.dot(step); }
  // In [0, 1).
  double GainShare() const {
    return square > 0 ? std::min(Gain() / square, 1 - 1e-12) : 0;
  }
  // Of the bound exp(-exponent) on the probability that noise gains as much. Of
  // noise of one size, `sigma_px` or the image's own, the gain is sigma^2 chi^2
  // with six degrees of freedom, and its share of all squared errors, in n
  // directions, has the distribution Beta(3, (n - 6) / 2).
  double GainExponent(double sigma_px) const;
  // Beyond the share that six parameters take of noise.
  double UnexpectedGainShare() const {
    const double expected = 6 / static_cast<double>(num_directions);
    return expected < 1 ? (GainShare() - expected) / (1 - expected) : 0;
  }
};

// To which a model of these errors was filtered: their 99.9 % quantile; 0 of
// none.
double FilterLimit(std::vector<double> errors_px);

// An image's squared errors up to a limit, as shares u of its square. Gaussian
// noise of sigma gives u the density lambda exp(-lambda u) / (1 - exp(-lambda))
// with lambda = limit^2 / (2 sigma^2), whatever is filtered beyond the limit;
// errors by chance fill the disc evenly: lambda = 0.
struct ErrorsInDisc {
  ErrorsInDisc(const std::vector<double>& errors_px, double limit_px);

  int64_t num = 0;
  double mean = 0;    // of u, at most that of an even disc
  double lambda = 0;  // the likeliest, not negative
  // Of Chernoff's bound on the probability of such a mean or one farther from
  // that of `other`, not negative: num KL(lambda, other).
  double Exponent(double other) const;
};

// Of Chernoff's bound exp(-exponent) on the probability that of so many trials,
// each of probability p, so many or more succeed; 0 if that is to be expected.
double SuccessExponent(int64_t num_successes, int64_t num_trials, double p);

// As Model::images; of the observations of which `noise` says that they are
// tested. Requires a valid model. O(observations).
std::vector<ImageSums> AddUpImages(const Model& model, const ModelNoise& noise);

}  // namespace krot::internal
