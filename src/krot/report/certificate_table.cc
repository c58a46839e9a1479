#include "krot/report/reports.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "krot/report/report_json.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

// Says what is fixed; the bound presupposes that.
std::string FixedSentence(const CertificateVerdict& verdict) {
  if (verdict.num_fixed_images + verdict.num_fixed_points == 0) return "";
  return "It takes " + Counted(verdict.num_fixed_images, "frame") + " and " +
         Counted(verdict.num_fixed_points, "point") +
         " as fixed where they stand in this model.\n";
}

std::string PositionsSentence(const CertificateVerdict& verdict) {
  if (verdict.positions.empty()) return "";
  return "It takes " + Counted(verdict.positions.size(), "known position") +
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
         Counted(support.size(), "observation") + ", worst first" + shown +
         "\n" + table.ToString();
}

std::string CertificateTable(const CertificateVerdict& verdict,
                             int max_observations) {
  TextTable bounds;
  // Rounded downwards, because more is not proved.
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
         bounds.ToString() + SupportTable(verdict.support, max_observations) +
         PositionsTable(verdict.positions, max_observations);
}

std::string BaselineTable(const Model& model,
                          const BaselineCertificate& certificate,
                          int max_pairs) {
  std::vector<const BaselineCertificate::Pair*> pairs;
  int64_t num_matches = 0, most = 0;
  for (const BaselineCertificate::Pair& pair : certificate.pairs) {
    pairs.push_back(&pair);
    num_matches += pair.num_matches;
    most += pair.most_explained;
  }
  std::string text =
      "The certificate holds: with the rotations of this model no baselines "
      "explain more\nthan " +
      Thousands(most) + " of the " + Thousands(num_matches) + " matches of " +
      Counted(pairs.size(), "pair") + " of images within " +
      FormatNumber(certificate.tolerance_px, 4) +
      " px of their epipolar lines.\nOf a pair that few explain, a rotation "
      "is wrong, or the matches are.\n";
  if (pairs.empty() || max_pairs == 0) return text;
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const BaselineCertificate::Pair* a,
                      const BaselineCertificate::Pair* b) {
                     return a->most_explained * b->num_matches <
                            b->most_explained * a->num_matches;
                   });
  std::map<ImageId, std::string> names;
  for (const Image& image : model.images) names[image.id] = image.name;
  TextTable table;
  table.AddRow({"image", "image", "matches", "explained", "proved at most"});
  for (size_t n = 0; n < std::min(pairs.size(), static_cast<size_t>(max_pairs));
       ++n) {
    table.AddRow({names[pairs[n]->image_id1], names[pairs[n]->image_id2],
                  Thousands(pairs[n]->num_matches),
                  Thousands(pairs[n]->num_explained),
                  Thousands(pairs[n]->most_explained)});
  }
  return text + table.ToString();
}

std::string ConflictTable(const ConflictVerdict& verdict) {
  return "The conflicts hold: whatever the translations and points, at least " +
         Counted(verdict.num_conflicts, "observation") +
         " must go\nfor all others to be within " +
         (verdict.has_own_bounds ? "their own bounds in the file, at most "
                                 : "") +
         FormatNumber(verdict.max_error, 6) + " px.\n  " +
         Counted(verdict.num_conflicts, "conflict") + " of " +
         Counted(verdict.num_observations, "observation") +
         " in all, none in two\n";
}

std::string CheckJson(const std::optional<CertificateVerdict>& certificate,
                      const std::optional<ConflictVerdict>& conflicts,
                      const std::optional<BaselineCertificate>& baselines,
                      const std::string& version) {
  Json of_conflicts;
  if (conflicts) {
    of_conflicts = {{"max_error", conflicts->max_error},
                    {"has_own_bounds", conflicts->has_own_bounds},
                    {"num_conflicts", conflicts->num_conflicts},
                    {"num_observations", conflicts->num_observations}};
  }
  Json of_baselines;
  if (baselines) {
    Json pairs = ListJson(baselines->pairs, [&](const auto& pair) -> Json {
      return {{"image_id1", pair.image_id1},
              {"image_id2", pair.image_id2},
              {"num_matches", pair.num_matches},
              {"num_explained", pair.num_explained},
              {"most_explained", pair.most_explained}};
    });
    of_baselines = {{"tolerance_px", baselines->tolerance_px},
                    {"pairs", pairs}};
  }
  const Json json = {{"version", version},
                     {"command", "certificate_checker"},
                     {"baselines", of_baselines},
                     {"certificate", VerdictJson(certificate)},
                     {"conflicts", of_conflicts}};
  return ReportText(json);
}

}  // namespace krot::internal
