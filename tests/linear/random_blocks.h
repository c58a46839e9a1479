#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/linear/blocks.h"

namespace krot::internal {

// A symmetric matrix, and its blocks that are not zero.
struct BlockMatrix {
  explicit BlockMatrix(Eigen::MatrixXd whole) : matrix(std::move(whole)) {
    const auto num_frames = static_cast<int32_t>(matrix.rows() / 3);
    for (int32_t j = 0; j < num_frames; ++j) {
      for (int32_t i = j; i < num_frames; ++i) {
        const Eigen::Matrix3d block = matrix.block<3, 3>(3 * i, 3 * j);
        if (i > j && block.isZero(0)) continue;
        pattern.row.push_back(i);
        blocks.push_back(block);
      }
      pattern.begin.push_back(pattern.num_blocks());
    }
  }

  Eigen::MatrixXd matrix;
  BlockPattern pattern;
  std::vector<Eigen::Matrix3d> blocks;
};

// Positive definite, as the normal equations of frames that share points
// without order: the sum of `num_terms` G'G of three frames each, of weights
// that span `decades`, and `ridge` I.
inline Eigen::MatrixXd RandomNormalEquations(int num_frames, int num_terms,
                                             double decades, double ridge) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> exponent(-decades / 2, decades / 2);
  Eigen::MatrixXd matrix =
      ridge * Eigen::MatrixXd::Identity(3 * num_frames, 3 * num_frames);
  for (int term = 0; term < num_terms; ++term) {
    const int a = term % num_frames;
    const int frames[] = {
        a, (a + 1) % num_frames,
        static_cast<int>(random() % static_cast<unsigned>(num_frames))};
    Eigen::Matrix<double, 2, 9> G;
    for (double& entry : G.reshaped()) entry = normal(random);
    const Eigen::Matrix<double, 9, 9> square =
        std::pow(10, exponent(random)) * G.transpose() * G;
    for (int m = 0; m < 3; ++m) {
      for (int n = 0; n < 3; ++n) {
        matrix.block<3, 3>(3 * frames[m], 3 * frames[n]) +=
            square.block<3, 3>(3 * m, 3 * n);
      }
    }
  }
  return matrix;
}

// Points of two to four frames by chance, some of them twice in a frame.
inline BlockStructure MakeRandomStructure(unsigned num_frames, unsigned seed) {
  std::mt19937 random(seed);
  BlockStructure structure;
  structure.point_begin = {0};
  for (unsigned k = 0; k < 2 * num_frames; ++k) {
    for (auto n = 2 + random() % 3; n > 0; --n) {
      structure.frame_of.push_back(static_cast<int32_t>(random() % num_frames));
    }
    structure.point_begin.push_back(
        static_cast<int64_t>(structure.frame_of.size()));
  }
  structure.frame_is_fixed.assign(num_frames, 0);
  structure.frame_is_fixed[3] = structure.frame_is_fixed[8] = 1;
  return structure;
}

}  // namespace krot::internal
