#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/database.h"
#include "krot/model.h"

namespace krot::internal {

inline constexpr int kBaselineCertificateVersion = 1;

// A proof of how many verified matches of pairs of images any baselines explain
// at most, the model's rotations being as they are (docs/formats.md). It holds
// neither pixels nor rotations: it is judged by a model and a database.
struct BaselineCertificate {
  struct Pair {
    ImageId image_id1 = 0;
    ImageId image_id2 = 0;
    int64_t num_matches = 0;     // whose pixels have rays
    int64_t num_explained = 0;   // by `baseline`
    int64_t most_explained = 0;  // no baseline explains more
    Eigen::Vector3d baseline = Eigen::Vector3d::Zero();  // world axes
    // Of the squares [-1, 1]^2 of directions (1, s, t), (t, 1, s), (s, t, 1),
    // one after the other: '0', or '1' and the same of its four quarters, from
    // small to large s and, of the same s, t.
    std::string cells;
  };

  int version = kBaselineCertificateVersion;
  double tolerance_px = 0;  // a match is explained up to this Sampson distance
  std::vector<Pair> pairs;
};

// Of all contradictory pairs.
BaselineCertificate DescribeBaselines(const Model& model,
                                      const PairCheck& check);

// JSON. Doubles come back with the same bits.
std::string BaselineJson(const BaselineCertificate& certificate);

// Whether a file is one of baselines, rather than of another kind.
bool HoldsBaselines(const std::string& json);

// The inverse of BaselineJson. Throws ModelError, with the place, and says
// nothing about what is proved.
BaselineCertificate ParseBaselines(const std::string& json,
                                   const std::string& file_name);

struct BaselineVerdict {
  bool is_accepted = false;
  std::string refusal;  // one sentence; empty if accepted
};

// Accepts if every pair has so many matches, its baseline explains as many of
// them as it says, and in none of its cells more than most_explained can be
// explained, by interval arithmetic over all directions of a cell. Takes the
// rays of pixels as the lens gives them in doubles, and accounts for every
// rounding from there on. Requires a valid model and a database read for it.
// O(cells * matches).
BaselineVerdict VerifyBaselines(const Model& model, const Database& database,
                                const BaselineCertificate& certificate);

}  // namespace krot::internal
