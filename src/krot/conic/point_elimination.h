#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace krot {

// The linear systems of the interior point, with the structure of bundle
// adjustment: every observation has `rows_per_observation` scaled rows, 3
// columns for its point and 3 for its frame, and
//
//   H = A'A + regularization,   A = [A_s  A_t],
//
// is solved by eliminating the points. The rows of a point are reduced by
// Householder reflections, Q'A_s = (R; 0); what they leave of the frames'
// columns is stacked into the normal equations of the frames. No 3x3 inverse
// and no difference of large matrices is formed: near an optimum, the rows
// differ by ten orders of magnitude.

// A vector with the structure of the unknowns.
struct BlockVector {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> frames;

  void SetZero(size_t num_points, size_t num_frames) {
    points.assign(num_points, Eigen::Vector3d::Zero());
    frames.assign(num_frames, Eigen::Vector3d::Zero());
  }
  double Dot(const BlockVector& other) const;
  void Add(double factor, const BlockVector& other);  // += factor * other
};

// Which observation sees what; observations stand in the order of points.
struct BlockStructure {
  int rows_per_observation = 3;
  std::vector<int64_t> point_begin;  // num_points + 1
  std::vector<int32_t> frame_of;     // per observation
  std::vector<char> frame_is_fixed;  // per frame: its columns are left out

  int64_t num_points() const {
    return static_cast<int64_t>(point_begin.size()) - 1;
  }
  int64_t num_observations() const { return point_begin.back(); }
  int64_t num_frames() const {
    return static_cast<int64_t>(frame_is_fixed.size());
  }
};

class PointElimination {
 public:
  // Keeps a reference to `structure`.
  PointElimination(const BlockStructure& structure, int num_threads);

  // Row-major blocks of A, rows_per_observation x 3 per observation, to be
  // filled before Factorize.
  double* point_rows(int64_t observation);
  double* frame_rows(int64_t observation);

  // Factorises H. Returns false if the frames' system is not positive
  // definite even with growing regularisation.
  bool Factorize();

  // x = H^-1 (g + A'r); r (rows_per_observation numbers per observation) may
  // be null.
  void Solve(const BlockVector& g, const double* r, BlockVector* x) const;

  // y = A x for one observation.
  void MultiplyRows(int64_t observation, const BlockVector& x, double* y) const;

 private:
  struct Reflections {
    double R[6];  // upper triangle, by rows
    double tau[3];
    double regular[9];  // the reflectors' part on the regularisation rows
  };

  void SolveOnce(const BlockVector& g, const double* r, BlockVector* x) const;
  void AddPointToFrameSystem(int64_t k, Eigen::MatrixXd* scratch,
                             Eigen::MatrixXd* gram, Eigen::MatrixXd* system);
  void ReducePoint(int64_t k);
  void ApplyQt(int64_t k, double* rows, double* regular) const;
  void ApplyQ(int64_t k, double* rows, double* regular) const;

  const BlockStructure& structure_;
  int num_threads_;
  int rows_;  // per observation
  std::vector<double> point_rows_;
  std::vector<double> frame_rows_;
  std::vector<double> reflectors_;  // in place of the point rows
  std::vector<Reflections> reflections_;
  std::vector<double> point_regularization_;
  std::vector<int32_t> column_of_frame_;  // -1: fixed
  int num_columns_ = 0;
  Eigen::LLT<Eigen::MatrixXd> frame_factor_;
};

}  // namespace krot
