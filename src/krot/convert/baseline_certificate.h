#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/database.h"
#include "krot/model.h"

namespace krot::internal {

inline constexpr int kBaselineCertificateVersion = 1;

// A proof of the largest number of verified matches that any baseline explains,
// pair by pair, with the model's rotations as they are (docs/formats.md). It
// contains neither pixels nor rotations: the checker takes them from a model
// and a database.
struct BaselineCertificate {
  struct Pair {
    ImageId image_id1 = 0;
    ImageId image_id2 = 0;
    int64_t num_matches = 0;     // matches whose pixels have rays
    int64_t num_explained = 0;   // matches that `baseline` explains
    int64_t most_explained = 0;  // no baseline explains more
    Eigen::Vector3d baseline = Eigen::Vector3d::Zero();  // world axes
    // How the directions of the baseline were divided. Directions are (1, s,
    // t), (t, 1, s) and (s, t, 1) with (s, t) in the square [-1, 1]^2; these
    // three squares follow one another. A square is '0', or '1' followed by its
    // four quarters: those with small s before those with large s and, for the
    // same s, small t before large t.
    std::string cells;
  };

  int version = kBaselineCertificateVersion;
  // A match is explained if Sampson's distance is at most this.
  double tolerance_px = 0;
  std::vector<Pair> pairs;
};

// The proofs of all contradictory pairs.
BaselineCertificate DescribeBaselines(const Model& model,
                                      const PairCheck& check);

// JSON. Doubles are restored with the same bits.
std::string BaselineJson(const BaselineCertificate& certificate);

// Whether a file holds baselines, rather than a proof of another kind.
bool HoldsBaselines(const std::string& json);

// The inverse of BaselineJson. Throws ModelError with the place in the text.
// Does not check what is proved.
BaselineCertificate ParseBaselines(const std::string& json,
                                   const std::string& file_name);

struct BaselineVerdict {
  bool is_accepted = false;
  std::string refusal;  // one sentence; empty if accepted
};

// Accepts if for every pair the number of matches agrees, the baseline explains
// at least num_explained of them, and no cell has more than most_explained
// matches that some direction in it could explain, by interval arithmetic. The
// rays of pixels are taken as the lens gives them in doubles; every rounding
// after that is accounted for. Requires a valid model and a database read for
// it. O(cells * matches).
BaselineVerdict VerifyBaselines(const Model& model, const Database& database,
                                const BaselineCertificate& certificate);

}  // namespace krot::internal
