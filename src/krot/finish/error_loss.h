#pragma once

#include <cmath>

namespace krot {

// rho of a squared error, squared pixels: rho(s) = s for small s, and less for
// what is beyond the scale. As in Ceres.
struct ErrorLoss {
  enum class Kind { kTrivial, kHuber, kCauchy };
  Kind kind = Kind::kTrivial;
  double scale = 1;  // pixels; > 0

  double Value(double s) const {
    const double b = scale * scale;
    switch (kind) {
      case Kind::kTrivial:
        break;
      case Kind::kHuber:
        return s <= b ? s : 2 * scale * std::sqrt(s) - b;
      case Kind::kCauchy:
        return b * std::log1p(s / b);
    }
    return s;
  }

  // rho'(s), in (0, 1].
  double Weight(double s) const {
    const double b = scale * scale;
    switch (kind) {
      case Kind::kTrivial:
        break;
      case Kind::kHuber:
        return s <= b ? 1 : scale / std::sqrt(s);
      case Kind::kCauchy:
        return 1 / (1 + s / b);
    }
    return 1;
  }
};

// As --Solver.finish_loss takes it: "trivial", "huber", "cauchy".
inline const char* LossName(ErrorLoss::Kind kind) {
  switch (kind) {
    case ErrorLoss::Kind::kHuber:
      return "huber";
    case ErrorLoss::Kind::kCauchy:
      return "cauchy";
    case ErrorLoss::Kind::kTrivial:
      break;
  }
  return "trivial";
}

}  // namespace krot
