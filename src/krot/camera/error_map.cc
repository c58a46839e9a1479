#include "krot/camera/error_map.h"

#include <array>

#include "krot/camera/enclosure.h"
#include "krot/camera/models.h"

namespace krot::internal {
namespace {

template <typename T>
T Dot(const Eigen::RowVector3d& row, const T (&x)[3]) {
  return x[0] * row[0] + x[1] * row[1] + x[2] * row[2];
}

template <typename Model>
class ModelErrorMap : public ErrorMap {
 public:
  ModelErrorMap(const double* params, const Geometry& geometry)
      : geometry_(geometry) {
    for (int i = 0; i < Model::kNumParams; ++i) {
      params_[i] = {params[i], params[i]};
    }
  }

  ErrorPair<Interval> Values(const Interval& q1,
                             const Interval& q2) const override {
    return Evaluate(q1, q2);
  }

  ErrorPair<Dual<Interval>> Derivatives(const Interval& q1,
                                        const Interval& q2) const override {
    const Interval one = {1, 1};
    const Interval zero = {0, 0};
    return Evaluate(Dual<Interval>{q1, one, zero},
                    Dual<Interval>{q2, zero, one});
  }

 private:
  template <typename T>
  ErrorPair<T> Evaluate(const T& q1, const T& q2) const {
    const Geometry& g = geometry_;
    T X[3];
    for (int i = 0; i < 3; ++i) {
      X[i] = q1 * g.G(i, 0) + q2 * g.G(i, 1) + g.X0[i];
    }
    ErrorPair<T> pair;
    EvaluateError(X, &pair.f[0], &pair.f[1]);
    const T w = Dot(g.E.row(0), X) * g.level_px;
    for (int i = 0; i < 2; ++i) {
      pair.f[i] = pair.f[i] / g.level_px;
      pair.m[i] = Dot(g.E.row(i + 1), X) / w;
    }
    return pair;
  }

  template <typename T>
  void EvaluateError(const T (&X)[3], T* x, T* y) const {
    const Eigen::Vector2d& pixel = geometry_.pixel;
    if constexpr (Model::kId != Equirectangular::kId) {
      if (geometry_.on_image_plane) {
        Model::Project(params_.data(), X[0], X[1], x, y);
        *x = *x - pixel.x();
        *y = *y - pixel.y();
        return;
      }
    }
    Model::ErrorAt(params_.data(), pixel.x(), pixel.y(), X[0], X[1], X[2], x,
                   y);
  }

  Geometry geometry_;
  std::array<Interval, Model::kNumParams> params_;
};

}  // namespace

std::unique_ptr<ErrorMap> MakeErrorMap(int model_id, const double* params,
                                       const ErrorMap::Geometry& geometry) {
  return VisitEveryCameraModel(
      model_id, [&](auto model) -> std::unique_ptr<ErrorMap> {
        return std::make_unique<ModelErrorMap<decltype(model)>>(params,
                                                                geometry);
      });
}

}  // namespace krot::internal
