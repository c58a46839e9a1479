#include "krot/analysis/epipolar.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/analysis/noise.h"
#include "krot/base/numbers.h"

namespace krot::internal {

MatchNoise EstimateMatchNoise(const std::vector<std::vector<double>>& errors_px,
                              const std::vector<double>& parallax_px) {
  const auto median_of = [](const std::vector<double>& errors) {
    return errors[errors.size() / 2];
  };
  std::vector<const std::vector<double>*> pairs, with_parallax;
  size_t num_matches = 0;
  for (size_t p = 0; p < errors_px.size(); ++p) {
    const std::vector<double>& errors = errors_px[p];
    if (errors.empty()) continue;
    pairs.push_back(&errors);
    num_matches += errors.size();
    if (parallax_px[p] >= 5 * median_of(errors)) {
      with_parallax.push_back(&errors);
    }
  }
  if (pairs.empty()) return {};
  if (!with_parallax.empty()) pairs = std::move(with_parallax);
  std::sort(pairs.begin(), pairs.end(), [&](const auto* a, const auto* b) {
    return median_of(*a) < median_of(*b);
  });
  const double largest_median = 2 * median_of(*pairs[pairs.size() / 4]);
  std::vector<double> better;
  for (const std::vector<double>* errors : pairs) {
    if (median_of(*errors) > largest_median) break;
    better.insert(better.end(), errors->begin(), errors->end());
  }
  MatchNoise noise;
  // The median of |x| is 0.6745 sigma for a Gaussian x.
  noise.sigma_px = std::max(Median(std::move(better)) / 0.6745, kLeastNoisePx);
  noise.tolerance_px =
      noise.sigma_px *
      std::sqrt(2 * std::log(static_cast<double>(num_matches) / 0.05));
  return noise;
}

namespace {

// A match's signed error under a pose of its image, and its derivatives by a
// change of that pose. The denominator is taken to be constant.
double MatchError(const WitnessMatch& match, const Eigen::Matrix3d& rotation,
                  const Eigen::Vector3d& center, PoseChange change,
                  Eigen::Vector3d* gradient) {
  const Eigen::Matrix3d world_from_cam = rotation.transpose();
  const PixelRay ray = world_from_cam * match.ray;
  const EpipolarMatch epipolar(ray, match.other_ray);
  const Eigen::Vector3d baseline = match.other_center - center;
  const double allowed = (epipolar.gradient * baseline).norm();
  if (!(allowed > 0)) {
    *gradient = Eigen::Vector3d::Zero();
    return 0;
  }
  if (change == PoseChange::kMove) {
    *gradient = -epipolar.normal / allowed;
  } else {
    // A rotation vector w in camera axes moves the ray d by -(R^T w) x d.
    *gradient = -rotation * ray.ray.cross(match.other_ray.ray.cross(baseline)) /
                allowed;
  }
  return epipolar.normal.dot(baseline) / allowed;
}

// Changes the rotation or the centre by a step: a rotation vector in camera
// axes, or a shift of the centre.
void ApplyStep(PoseChange change, const Eigen::Vector3d& step,
               Eigen::Matrix3d* rotation, Eigen::Vector3d* center) {
  if (change == PoseChange::kMove) {
    *center += step;
  } else if (step.norm() > 0) {
    *rotation = Eigen::AngleAxisd(step.norm(), step.normalized()) * *rotation;
  }
}

// The sum of absolute errors under a pose, and the step that is to lower it.
struct FitStep {
  double sum = 0;
  Eigen::Vector3d step = Eigen::Vector3d::Zero();
};

FitStep StepAt(const std::vector<WitnessMatch>& matches,
               const Eigen::Matrix3d& rotation, const Eigen::Vector3d& center,
               PoseChange change, double noise_px) {
  FitStep at;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
  for (const WitnessMatch& match : matches) {
    Eigen::Vector3d gradient;
    const double error = MatchError(match, rotation, center, change, &gradient);
    const double weight = 1 / std::max(std::abs(error), noise_px);
    normal += weight * gradient * gradient.transpose();
    right_side -= weight * error * gradient;
    at.sum += std::abs(error);
  }
  at.step = normal.ldlt().solve(right_side);
  return at;
}

}  // namespace

RigidTransform FitEpipolarPose(const std::vector<WitnessMatch>& matches,
                               const RigidTransform& cam_from_world,
                               PoseChange change, double noise_px) {
  Eigen::Matrix3d rotation = cam_from_world.rotation;
  Eigen::Vector3d center = Center(cam_from_world);
  if (matches.empty()) return cam_from_world;
  FitStep at = StepAt(matches, rotation, center, change, noise_px);
  for (int i = 0; i < 50 && at.step.allFinite(); ++i) {
    // The step is halved until the sum falls.
    FitStep next{at.sum, at.step};
    Eigen::Matrix3d next_rotation;
    Eigen::Vector3d next_center;
    for (int halvings = 0; halvings < 20 && next.sum >= at.sum; ++halvings) {
      next_rotation = rotation;
      next_center = center;
      ApplyStep(change, at.step, &next_rotation, &next_center);
      next = StepAt(matches, next_rotation, next_center, change, noise_px);
      at.step /= 2;
    }
    if (!(next.sum < at.sum)) break;
    rotation = next_rotation;
    center = next_center;
    const bool is_last = next.sum > (1 - 1e-4) * at.sum;
    at = next;
    if (is_last) break;
  }
  return {rotation, -rotation * center};
}

std::vector<double> EpipolarErrors(const std::vector<WitnessMatch>& matches,
                                   const RigidTransform& cam_from_world) {
  const Eigen::Vector3d center = Center(cam_from_world);
  const Eigen::Matrix3d world_from_cam = cam_from_world.rotation.transpose();
  std::vector<double> errors;
  errors.reserve(matches.size());
  for (const WitnessMatch& match : matches) {
    errors.push_back(EpipolarMatch(world_from_cam * match.ray, match.other_ray)
                         .ErrorPx(match.other_center - center));
  }
  return errors;
}

namespace {

// A square of directions on the face of the cube where coordinate `face` is 1.
struct Cell {
  int face = 0;
  double s = 0, t = 0;  // its centre, in the two other coordinates
  double half_width = 1;
  int64_t num_sure = 0;       // matches that all its directions explain
  int64_t order = 0;          // when it was made
  std::vector<int32_t> open;  // matches that some of its directions may explain

  int64_t upper_bound() const {
    return num_sure + static_cast<int64_t>(open.size());
  }
};

// The highest upper bound comes first; of equals the smallest cell, which is
// the nearest to an answer.
struct IsLessPromising {
  bool operator()(const Cell& a, const Cell& b) const {
    return std::make_tuple(a.upper_bound(), -a.half_width, -a.order) <
           std::make_tuple(b.upper_bound(), -b.half_width, -b.order);
  }
};

class CellSearch {
 public:
  CellSearch(const std::vector<EpipolarMatch>& matches, double tolerance_px,
             int64_t max_cells)
      : tolerance_px_(tolerance_px), max_cells_(max_cells) {
    for (int face = 0; face < 3; ++face) {
      conditions_[face].reserve(matches.size());
      for (const EpipolarMatch& match : matches) {
        conditions_[face].push_back(ConditionOn(face, match));
      }
    }
    all_.resize(matches.size());
    std::iota(all_.begin(), all_.end(), 0);
  }

  BaselineSearch Run() {
    for (int face = 0; face < 3; ++face) {
      Cell cell;
      cell.face = face;
      Look(std::move(cell), 0, all_);
    }
    while (!cells_.empty() && best_.num_cells < max_cells_ &&
           cells_.front().upper_bound() > best_.num_explained) {
      std::pop_heap(cells_.begin(), cells_.end(), IsLessPromising());
      const Cell cell = std::move(cells_.back());
      cells_.pop_back();
      first_part_[cell.order] = best_.num_cells;
      const double half = cell.half_width / 2;
      for (const double ds : {-half, half}) {
        for (const double dt : {-half, half}) {
          Cell part;
          part.face = cell.face;
          part.s = cell.s + ds;
          part.t = cell.t + dt;
          part.half_width = half;
          Look(std::move(part), cell.num_sure, cell.open);
        }
      }
    }
    best_.upper_bound = std::max(best_.num_explained, unresolved_);
    if (!cells_.empty()) {
      best_.upper_bound =
          std::max(best_.upper_bound, cells_.front().upper_bound());
    }
    for (int64_t face = 0; face < 3; ++face) DescribeCell(face);
    return best_;
  }

 private:
  // Appends a cell and its parts as BaselineCertificate has them. The recursion
  // is no deeper than the smallest cells allow.
  void DescribeCell(int64_t order) {
    const int64_t first = first_part_[order];
    best_.cells += first < 0 ? '0' : '1';
    if (first < 0) return;
    for (int64_t part = first; part < first + 4; ++part) DescribeCell(part);
  }

  // A match in the coordinates (1, s, t) of a face.
  struct Condition {
    Eigen::Vector3d normal;
    Eigen::Matrix<double, 4, 3> gradient;
    // By how much |normal . b| and the tolerance times |gradient b| change at
    // most, taken together, per half width of a cell.
    double change;
  };

  Condition ConditionOn(int face, const EpipolarMatch& match) const {
    Condition condition;
    for (int i = 0; i < 3; ++i) {
      condition.normal[i] = match.normal[(face + i) % 3];
      condition.gradient.col(i) = match.gradient.col((face + i) % 3);
    }
    condition.change = std::abs(condition.normal[1]) +
                       std::abs(condition.normal[2]) +
                       tolerance_px_ * (condition.gradient.col(1).norm() +
                                        condition.gradient.col(2).norm());
    return condition;
  }

  // Sorts the matches that the surrounding cell left open, counts how many the
  // centre explains, and keeps the cell if it may hold a better direction.
  void Look(Cell cell, int64_t num_sure, const std::vector<int32_t>& open) {
    cell.num_sure = num_sure;
    cell.order = best_.num_cells++;
    first_part_.push_back(-1);
    open_.clear();
    int64_t num_at_centre = num_sure;
    int64_t num_possible = num_sure + static_cast<int64_t>(open.size());
    const Eigen::Vector3d b(1, cell.s, cell.t);
    const auto square = [](double x) { return x * x; };
    for (const int32_t k : open) {
      const Condition& condition = conditions_[cell.face][k];
      const double distance = std::abs(condition.normal.dot(b));
      const double change = cell.half_width * condition.change;
      const double allowed =
          square(tolerance_px_) * (condition.gradient * b).squaredNorm();
      if (square(distance) <= allowed) ++num_at_centre;
      // A match is given up only if it is off by more than rounding. So the
      // checker's interval arithmetic, which rounds outwards, gives it up, too.
      if (square(distance + change) <= allowed) {
        ++cell.num_sure;
      } else if (distance <= change ||
                 square(distance - change) <= (1 + 1e-10) * allowed) {
        open_.push_back(k);
      } else if (--num_possible <= best_.num_explained) {
        return;
      }
    }
    if (num_at_centre > best_.num_explained) {
      best_.num_explained = num_at_centre;
      for (int i = 0; i < 3; ++i) best_.baseline[(cell.face + i) % 3] = b[i];
      best_.baseline.normalize();
    }
    const int64_t upper_bound =
        cell.num_sure + static_cast<int64_t>(open_.size());
    if (upper_bound <= best_.num_explained) return;
    if (cell.half_width < 1e-12) {
      unresolved_ = std::max(unresolved_, upper_bound);
      return;
    }
    cell.open = open_;
    cells_.push_back(std::move(cell));
    std::push_heap(cells_.begin(), cells_.end(), IsLessPromising());
  }

  const double tolerance_px_;
  const int64_t max_cells_;
  std::array<std::vector<Condition>, 3> conditions_;
  std::vector<int32_t> all_;
  std::vector<Cell> cells_;    // a heap
  std::vector<int32_t> open_;  // of the cell that is looked at
  BaselineSearch best_;
  int64_t unresolved_ = 0;
  std::vector<int64_t> first_part_;  // of each cell; -1: it is not divided
};

}  // namespace

BaselineSearch SearchBaseline(const std::vector<EpipolarMatch>& matches,
                              double tolerance_px, int64_t max_cells) {
  return CellSearch(matches, tolerance_px, max_cells).Run();
}

}  // namespace krot::internal
