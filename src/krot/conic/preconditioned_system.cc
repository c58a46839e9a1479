#include "krot/conic/preconditioned_system.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/base/parallel_for.h"

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// More would not end either, or not soon.
constexpr int kMaxIterations = 2000;
// What an operation takes, by one of a dense factor in double precision: in
// single precision, and for a number of a matrix that is multiplied by a
// vector, which waits for memory.
constexpr double kOperationInSingle = 0.5;
constexpr double kNumberRead = 60;
// Systems that are solved with a factor: an interior point's, each refined.
constexpr int kSolves = 12;
// Iterations that a solve is thought to take: those of an incomplete factor
// grow from 30 to 200 and more on the way to an optimum, others' less.
constexpr int kIncompleteIterations = 100;
constexpr int kSingleIterations = 4;
constexpr int kDoubleIterations = 2;
// Products are summed in so many parts.
constexpr int kNumChunks = 4;
// Relative to the trace of a block: keeps its inverse factor finite.
constexpr double kSmallestWhitenedPivot = 1e-14;
// Added to a dense factor's unit diagonal, until it exists.
constexpr float kShiftInSingle = 1e-6F;
constexpr double kShiftInDouble = 1e-14;
constexpr int kDenseShiftGrowth = 10;
constexpr int kLargestDenseShift = 10;

// W with W A W' = I, where A has full rank.
Matrix3d Whitening(const Matrix3d& A) {
  const double floor = kSmallestWhitenedPivot * A.trace();
  Matrix3d W = Matrix3d::Zero();
  if (!(floor > 0)) return W;
  const auto inverse_root = [&](double pivot) {
    return 1 / std::sqrt(std::max(pivot, floor));
  };
  const double i00 = inverse_root(A(0, 0));
  const double l10 = A(1, 0) * i00;
  const double l20 = A(2, 0) * i00;
  const double i11 = inverse_root(A(1, 1) - l10 * l10);
  const double l21 = (A(2, 1) - l20 * l10) * i11;
  const double i22 = inverse_root(A(2, 2) - l20 * l20 - l21 * l21);
  const double i10 = -l10 * i00 * i11;
  W << i00, 0, 0,   //
      i10, i11, 0,  //
      -(l20 * i00 + l21 * i10) * i22, -l21 * i11 * i22, i22;
  return W;
}

int64_t NumColumns(const BlockPattern& pattern) {
  return 3 * int64_t{pattern.num_columns()};
}

// Of a factor and kSolves solves of so many iterations. Those with a dense
// factor read little else.
double CostOf(Preconditioner preconditioner, const BlockPattern& pattern,
              int num_iterations) {
  const auto n = static_cast<double>(NumColumns(pattern));
  const double num_reads = kNumberRead * kSolves * num_iterations;
  switch (preconditioner) {
    case Preconditioner::kIncomplete:
      return kSparseOperation * IncompleteCholesky::Operations(pattern) +
             num_reads * 9 * static_cast<double>(pattern.num_blocks());
    case Preconditioner::kSingle:
      return kOperationInSingle * n * n * n / 3 + num_reads * n * n / 2;
    case Preconditioner::kDouble:
      return n * n * n / 3 + 2 * num_reads * n * n / 2;
  }
  return 0;
}

double IncompleteCost(const BlockPattern& pattern) {
  return CostOf(Preconditioner::kIncomplete, pattern, kIncompleteIterations);
}
double SingleCost(const BlockPattern& pattern) {
  return CostOf(Preconditioner::kSingle, pattern, kSingleIterations);
}
double DoubleCost(const BlockPattern& pattern) {
  return CostOf(Preconditioner::kDouble, pattern, kDoubleIterations);
}

}  // namespace

double PreconditionedSystem::Cost(const BlockPattern& pattern) {
  return std::min(IncompleteCost(pattern), SingleCost(pattern));
}

PreconditionedSystem::PreconditionedSystem(const BlockPattern& pattern)
    : pattern_(pattern),
      preconditioner_(IncompleteCost(pattern) < SingleCost(pattern)
                          ? Preconditioner::kIncomplete
                          : Preconditioner::kSingle) {
  // Columns of about as many blocks each.
  for (int32_t j = 0; j < pattern.num_columns(); ++j) {
    const auto chunk = static_cast<int64_t>(chunk_begin_.size());
    if (kNumChunks * pattern.begin[j] >= chunk * pattern.num_blocks()) {
      chunk_begin_.push_back(j);
    }
  }
  chunk_begin_.push_back(pattern.num_columns());
}

bool PreconditionedSystem::Factorize(std::vector<Matrix3d> blocks,
                                     int num_threads) {
  blocks_ = std::move(blocks);
  num_threads_ = num_threads;
  Whiten();
  if (IsNextCheaper(std::exchange(most_iterations_, 0))) Escalate();
  return FactorizePreconditioner();
}

// Than this one, if it takes so many iterations.
bool PreconditionedSystem::IsNextCheaper(int num_iterations) const {
  const double cost = CostOf(preconditioner_, pattern_, num_iterations);
  switch (preconditioner_) {
    case Preconditioner::kIncomplete:
      return cost > SingleCost(pattern_);
    case Preconditioner::kSingle:
      return cost > DoubleCost(pattern_);
    case Preconditioner::kDouble:
      break;
  }
  return false;
}

void PreconditionedSystem::Escalate() {
  if (preconditioner_ == Preconditioner::kIncomplete) {
    preconditioner_ = Preconditioner::kSingle;
    incomplete_ = {};
  } else {
    preconditioner_ = Preconditioner::kDouble;
    single_ = {};
  }
}

// This one or, if it has none, the next.
bool PreconditionedSystem::FactorizePreconditioner() {
  while (!TryPreconditioner()) {
    if (preconditioner_ == Preconditioner::kDouble) return false;
    Escalate();
  }
  return true;
}

bool PreconditionedSystem::TryPreconditioner() {
  switch (preconditioner_) {
    case Preconditioner::kIncomplete:
      return incomplete_.Factorize(pattern_, blocks_);
    case Preconditioner::kSingle:
      return FactorizeDense(kShiftInSingle, &single_);
    case Preconditioner::kDouble:
      return FactorizeDense(kShiftInDouble, &double_);
  }
  return false;
}

void PreconditionedSystem::Whiten() {
  W_.resize(pattern_.num_columns());
  for (int32_t j = 0; j < pattern_.num_columns(); ++j) {
    W_[j] = Whitening(blocks_[pattern_.begin[j]]);
  }
  for (int32_t j = 0; j < pattern_.num_columns(); ++j) {
    for (int64_t n = pattern_.begin[j]; n < pattern_.begin[j + 1]; ++n) {
      blocks_[n] = W_[pattern_.row[n]] * blocks_[n] * W_[j].transpose();
    }
  }
}

template <typename Scalar>
bool PreconditionedSystem::FactorizeDense(Scalar first_shift,
                                          DenseCholesky<Scalar>* factor) {
  for (Scalar shift = first_shift; shift <= kLargestDenseShift;
       shift *= kDenseShiftGrowth) {
    factor->SetZero(NumColumns(pattern_));
    for (int32_t j = 0; j < pattern_.num_columns(); ++j) {
      for (int64_t n = pattern_.begin[j]; n < pattern_.begin[j + 1]; ++n) {
        const int64_t row = 3 * int64_t{pattern_.row[n]};
        const int64_t column = 3 * int64_t{j};
        for (int c = 0; c < 3; ++c) {
          for (int r = row == column ? c : 0; r < 3; ++r) {
            factor->At(row + r, column + c) =
                static_cast<Scalar>(blocks_[n](r, c));
          }
        }
      }
      for (int64_t k = 3 * int64_t{j}; k < 3 * int64_t{j} + 3; ++k) {
        factor->At(k, k) += shift;
      }
    }
    if (factor->Factorize(num_threads_)) return true;
  }
  return false;
}

VectorXd PreconditionedSystem::Precondition(const VectorXd& residual) const {
  if (preconditioner_ == Preconditioner::kDouble) {
    return double_.Solve(residual);
  }
  // Scaled, as the exponents of single precision end early.
  const double scale = residual.cwiseAbs().maxCoeff();
  if (!(scale > 0)) return VectorXd::Zero(residual.size());
  const Eigen::VectorXf scaled = (residual / scale).cast<float>();
  return scale * (preconditioner_ == Preconditioner::kSingle
                      ? single_.Solve(scaled)
                      : incomplete_.Solve(scaled))
                     .cast<double>();
}

VectorXd PreconditionedSystem::Multiply(const VectorXd& x) const {
  const auto num_chunks = static_cast<int64_t>(chunk_begin_.size()) - 1;
  std::vector<VectorXd> parts(num_chunks, VectorXd::Zero(x.size()));
  ParallelFor(num_chunks, 1, num_threads_, [&](int64_t chunk, int64_t, int) {
    VectorXd& y = parts[chunk];
    for (int32_t j = chunk_begin_[chunk]; j < chunk_begin_[chunk + 1]; ++j) {
      const int64_t column = 3 * int64_t{j};
      const Vector3d x_j = x.segment<3>(column);
      Vector3d y_j = blocks_[pattern_.begin[j]] * x_j;
      for (int64_t n = pattern_.begin[j] + 1; n < pattern_.begin[j + 1]; ++n) {
        const int64_t row = 3 * int64_t{pattern_.row[n]};
        y.segment<3>(row).noalias() += blocks_[n] * x_j;
        y_j.noalias() += blocks_[n].transpose() * x.segment<3>(row);
      }
      y.segment<3>(column) += y_j;
    }
  });
  for (int64_t chunk = 1; chunk < num_chunks; ++chunk) {
    parts[0] += parts[chunk];
  }
  return parts[0];
}

VectorXd PreconditionedSystem::Solve(const VectorXd& rhs, double tolerance) {
  const int64_t num_columns = NumColumns(pattern_);
  VectorXd whitened(num_columns);
  for (int64_t k = 0; k < num_columns; k += 3) {
    whitened.segment<3>(k) = W_[k / 3] * rhs.segment<3>(k);
  }
  VectorXd y;
  while (!Iterate(whitened, tolerance, &y) &&
         preconditioner_ != Preconditioner::kDouble) {
    Escalate();
    if (!FactorizePreconditioner()) break;
  }
  for (int64_t k = 0; k < num_columns; k += 3) {
    y.segment<3>(k) = (W_[k / 3].transpose() * y.segment<3>(k)).eval();
  }
  return y;
}

// From y = 0; false if it does not end. With M the preconditioner, |error|_A^2
// = r'A^-1 r is about r'M r.
bool PreconditionedSystem::Iterate(VectorXd residual, double tolerance,
                                   VectorXd* y) {
  *y = VectorXd::Zero(residual.size());
  VectorXd preconditioned = Precondition(residual);
  VectorXd direction = preconditioned;
  double error = residual.dot(preconditioned);
  const double end = tolerance * tolerance * error;
  num_iterations_ = 0;
  while (error > end && num_iterations_ < kMaxIterations) {
    const VectorXd image = Multiply(direction);
    const double curvature = direction.dot(image);
    if (!(curvature > 0)) break;  // rounding
    const double step = error / curvature;
    *y += step * direction;
    const VectorXd change = -step * image;
    residual += change;
    preconditioned = Precondition(residual);
    direction = preconditioned + change.dot(preconditioned) / error * direction;
    error = residual.dot(preconditioned);
    ++num_iterations_;
  }
  most_iterations_ = std::max(most_iterations_, num_iterations_);
  return num_iterations_ < kMaxIterations;
}

int64_t PreconditionedSystem::MemoryBytes(const BlockPattern& pattern) {
  constexpr auto kBlock = static_cast<int64_t>(sizeof(Matrix3d));
  return (pattern.num_blocks() + pattern.num_columns()) * kBlock +
         std::max(IncompleteCholesky::MemoryBytes(pattern),
                  DenseCholesky<double>::MemoryBytes(NumColumns(pattern)));
}

}  // namespace krot
