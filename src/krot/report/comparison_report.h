#pragma once

#include <optional>
#include <string>

#include "krot/analysis/model_comparison.h"
#include "krot/bridge/certificate_verdict.h"
#include "krot/model/contradictions.h"

namespace krot::internal {

// How two models differ: `krot model_comparer`.
struct ComparisonReport {
  std::string version;
  ComparisonSummary summary;
  Contradictions contradictions1;  // of the models as their files have them
  Contradictions contradictions2;
  // Accepted ones, where given.
  std::optional<CertificateVerdict> certificate1;
  std::optional<CertificateVerdict> certificate2;
};

// "frame", "similarity" or "none".
std::string AlignmentName(AlignmentKind kind);

// For the terminal; of images, points and supports the `max_rows` worst.
std::string ComparisonTable(const ComparisonReport& report, int max_rows);

// The same as JSON, with all shared images; docs/formats.md lists the keys.
std::string ComparisonJson(const ComparisonReport& report);

// COLMAP's errors.csv: one line per shared image with a pose in both, holding
// the angle between its rotations in degrees and the distance of its centres;
// then its name.
std::string PoseErrorsCsv(const ComparisonSummary& summary);

}  // namespace krot::internal
