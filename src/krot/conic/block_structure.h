#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Which observation sees what; observations stand in the order of points.
struct BlockStructure {
  std::vector<int64_t> point_begin;  // num_points + 1
  std::vector<int32_t> frame_of;     // per observation
  std::vector<char> frame_is_fixed;  // per frame: it has no columns
  std::vector<char> point_is_fixed;  // per point, likewise; empty: none is

  bool IsFixedPoint(int64_t k) const {
    return !point_is_fixed.empty() && point_is_fixed[k] != 0;
  }

  int64_t num_points() const {
    return static_cast<int64_t>(point_begin.size()) - 1;
  }
  int64_t num_observations() const { return point_begin.back(); }
  int64_t num_frames() const {
    return static_cast<int64_t>(frame_is_fixed.size());
  }
};

// That of a problem: what it fixes is, and for the translation's gauge, of each
// connected component in which it fixes nothing, the frame with the most
// observations. So is a frame without any. Where ranks share the points, these
// are those of the whole.
BlockStructure AnchoredStructure(const KnownRotationProblem& problem,
                                 const Context& context = {});

// Per point, the places of its observations among them, in the order of their
// frames.
std::vector<int32_t> OrderByFrame(const BlockStructure& structure);

// A vector with the structure of the unknowns.
struct BlockVector {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> frames;

  void SetZero(size_t num_points, size_t num_frames) {
    points.assign(num_points, Eigen::Vector3d::Zero());
    frames.assign(num_frames, Eigen::Vector3d::Zero());
  }
  double Dot(const BlockVector& other) const {
    double sum = 0;
    for (size_t k = 0; k < points.size(); ++k) {
      sum += points[k].dot(other.points[k]);
    }
    for (size_t f = 0; f < frames.size(); ++f) {
      sum += frames[f].dot(other.frames[f]);
    }
    return sum;
  }
  void Add(double factor, const BlockVector& other) {  // += factor * other
    for (size_t k = 0; k < points.size(); ++k) {
      points[k] += factor * other.points[k];
    }
    for (size_t f = 0; f < frames.size(); ++f) {
      frames[f] += factor * other.frames[f];
    }
  }
};

}  // namespace krot
