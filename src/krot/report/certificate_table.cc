#include "krot/report/certificate_table.h"

#include <algorithm>
#include <cmath>

#include "krot/report/report_json.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

std::string LinearisedSentence(const CertificateVerdict& verdict) {
  if (!verdict.is_linearised) return "";
  return "Its file is of version 1: the error that it speaks of is linearised "
         "at the\nobservation, which is exact for pinhole cameras alone.\n";
}

// What the bound presupposes beside rotations.
std::string FixedSentence(const CertificateVerdict& verdict) {
  if (verdict.num_fixed_images + verdict.num_fixed_points == 0) return "";
  return "It takes " + Counted(verdict.num_fixed_images, "frame") + " and " +
         Counted(verdict.num_fixed_points, "point") +
         " as fixed where they stand in this model.\n";
}

std::string PositionsSentence(const CertificateVerdict& verdict) {
  if (verdict.positions.empty()) return "";
  return "It takes " +
         Counted(static_cast<int64_t>(verdict.positions.size()),
                 "known position") +
         " of its file to be kept to the radii below.\n";
}

}  // namespace

std::string PositionsTable(const std::vector<SupportPosition>& positions,
                           int max_positions) {
  if (positions.empty()) return "";
  const size_t count =
      std::min(positions.size(), static_cast<size_t>(max_positions));
  TextTable table;
  table.AddRow({"position of", "share", "distance", "radius"});
  for (size_t n = 0; n < count; ++n) {
    const SupportPosition& p = positions[n];
    table.AddRow({p.Name(), FormatNumber(p.share, 4),
                  FormatNumber(p.distance, 6), FormatNumber(p.radius, 6)});
  }
  return "\nKnown positions that hold against the support: " +
         std::to_string(positions.size()) +
         (count < positions.size() ? "; the first " + std::to_string(count)
                                   : std::string()) +
         "\n" + table.ToString();
}

std::string SupportTable(const std::vector<SupportObservation>& support,
                         int max_observations) {
  const size_t count =
      std::min(support.size(), static_cast<size_t>(max_observations));
  TextTable table;
  table.AddRow({"image", "point2D_idx", "point3D_id", "multiplier", "error"});
  for (size_t n = 0; n < count; ++n) {
    const SupportObservation& o = support[n];
    table.AddRow({o.image_name, std::to_string(o.point2D_idx),
                  std::to_string(o.point3D_id), FormatNumber(o.multiplier, 6),
                  FormatNumber(o.error_px, 4)});
  }
  const std::string shown =
      count < support.size() ? "; the first " + std::to_string(count) : "";
  return "\nThe support, which alone sets the maximum: " +
         Counted(static_cast<int64_t>(support.size()), "observation") +
         ", worst first" + shown + "\n" + table.ToString();
}

std::string CertificateTable(const CertificateVerdict& verdict,
                             int max_observations) {
  TextTable bounds;
  // Downwards: more than this is not claimed.
  bounds.AddRow({"lower bound",
                 FormatNumber(std::floor(verdict.lower_bound * 1e6) / 1e6, 6)});
  bounds.AddRow({"this model", verdict.cost ? FormatNumber(*verdict.cost, 6)
                                            : "behind a camera"});
  bounds.AddRow({"relative gap", verdict.relative_gap
                                     ? Scientific(*verdict.relative_gap)
                                     : "-"});
  return "The certificate holds: whatever the translations and points, the "
         "largest\nerror is at least the lower bound, in pixels.\n" +
         FixedSentence(verdict) + PositionsSentence(verdict) +
         LinearisedSentence(verdict) + bounds.ToString() +
         SupportTable(verdict.support, max_observations) +
         PositionsTable(verdict.positions, max_observations);
}

std::string CheckJson(const std::optional<CertificateVerdict>& certificate,
                      const std::optional<ConflictVerdict>& conflicts,
                      const std::string& version) {
  Json of_conflicts;
  if (conflicts) {
    of_conflicts = {{"max_error", conflicts->max_error},
                    {"num_conflicts", conflicts->num_conflicts},
                    {"num_observations", conflicts->num_observations}};
  }
  const Json json = {{"version", version},
                     {"command", "certificate_checker"},
                     {"certificate", VerdictJson(certificate)},
                     {"conflicts", of_conflicts}};
  return ReportText(json);
}

}  // namespace krot::internal
