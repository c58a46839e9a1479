#include "krot/report/reports.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "krot/report/report_json.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

// "; the first 10", where not all are shown.
std::string ShownWords(size_t count, int max_rows) {
  return TextIf(count > static_cast<size_t>(max_rows),
                "; the first " + std::to_string(max_rows));
}

}  // namespace

std::string PositionsTable(const std::vector<SupportPosition>& positions,
                           int max_positions) {
  if (positions.empty()) return "";
  return "\nKnown positions that hold against the support: " +
         std::to_string(positions.size()) +
         ShownWords(positions.size(), max_positions) + "\n" +
         TableOf(
             {"position of", "share", "distance", "radius"}, positions,
             [](const SupportPosition& p) -> Row {
               return {p.Name(), FormatNumber(p.share, 4),
                       FormatNumber(p.distance, 6), FormatNumber(p.radius, 6)};
             },
             static_cast<size_t>(max_positions));
}

std::string SupportTable(const std::vector<SupportObservation>& support,
                         int max_observations) {
  return "\nThe support, which alone sets the maximum: " +
         Counted(support.size(), "observation") + ", worst first" +
         ShownWords(support.size(), max_observations) + "\n" +
         TableOf(
             {"image", "point2D_idx", "point3D_id", "multiplier", "error"},
             support,
             [](const SupportObservation& o) -> Row {
               return {o.image_name, o.point2D_idx, o.point3D_id,
                       FormatNumber(o.multiplier, 6),
                       FormatNumber(o.error_px, 4)};
             },
             static_cast<size_t>(max_observations));
}

std::string CertificateTable(const CertificateVerdict& verdict,
                             int max_observations) {
  // Rounded downwards, because more is not proved.
  TextTable bounds(
      {"lower bound",
       FormatNumber(std::floor(verdict.lower_bound * 1e6) / 1e6, 6)});
  bounds.AddRow({"this model", verdict.cost ? FormatNumber(*verdict.cost, 6)
                                            : "behind a camera"});
  bounds.AddRow({"relative gap", Scientific(verdict.relative_gap)});
  return "The certificate holds: whatever the translations and points, the "
         "largest\nerror is at least the lower bound, in pixels.\n" +
         // The bound presupposes what is fixed.
         TextIf(verdict.num_fixed_images + verdict.num_fixed_points > 0,
                "It takes " + Counted(verdict.num_fixed_images, "frame") +
                    " and " + Counted(verdict.num_fixed_points, "point") +
                    " as fixed where they stand in this model.\n") +
         TextIf(!verdict.positions.empty(),
                "It takes " +
                    Counted(verdict.positions.size(), "known position") +
                    " of its file to be kept to the radii below.\n") +
         bounds.ToString() + SupportTable(verdict.support, max_observations) +
         PositionsTable(verdict.positions, max_observations);
}

std::string BaselineTable(const Model& model,
                          const BaselineCertificate& certificate,
                          int max_pairs) {
  using Pair = BaselineCertificate::Pair;
  std::vector<Pair> pairs = certificate.pairs;
  int64_t num_matches = 0, most = 0;
  for (const Pair& pair : pairs) {
    num_matches += pair.num_matches;
    most += pair.most_explained;
  }
  std::string text =
      "The certificate holds: with the rotations of this model no baselines "
      "explain more\nthan " +
      Thousands(most) + " of the " + Thousands(num_matches) + " matches of " +
      Counted(pairs.size(), "pair") + " of images within " +
      Pixels(certificate.tolerance_px) +
      " of their epipolar lines.\nOf a pair that few explain, a rotation "
      "is wrong, or the matches are.\n";
  if (pairs.empty() || max_pairs == 0) return text;
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) {
                     return a.most_explained * b.num_matches <
                            b.most_explained * a.num_matches;
                   });
  std::map<ImageId, std::string> names;
  for (const Image& image : model.images) names[image.id] = image.name;
  return text +
         TableOf(
             {"image", "image", "matches", "explained", "proved at most"},
             pairs,
             [&](const Pair& pair) -> Row {
               return {names[pair.image_id1], names[pair.image_id2],
                       Thousands(pair.num_matches),
                       Thousands(pair.num_explained),
                       Thousands(pair.most_explained)};
             },
             static_cast<size_t>(max_pairs));
}

std::string ConflictTable(const ConflictVerdict& verdict) {
  return "The conflicts hold: whatever the translations and points, at least " +
         Counted(verdict.num_conflicts, "observation") +
         " must go\nfor all others to be within " +
         (verdict.has_own_bounds ? "their own bounds in the file, at most "
                                 : "") +
         Pixels(verdict.max_error, 6) + ".\n  " +
         Counted(verdict.num_conflicts, "conflict") + " of " +
         Counted(verdict.num_observations, "observation") +
         " in all, none in two\n";
}

std::string CheckJson(const std::optional<CertificateVerdict>& certificate,
                      const std::optional<ConflictVerdict>& conflicts,
                      const std::optional<BaselineCertificate>& baselines,
                      const std::string& version) {
  const auto of_conflicts = [](const ConflictVerdict& verdict) {
    return KROT_JSON_OF(verdict, max_error, has_own_bounds, num_conflicts,
                        num_observations);
  };
  const auto of_pair = [](const BaselineCertificate::Pair& pair) {
    return KROT_JSON_OF(pair, image_id1, image_id2, num_matches, num_explained,
                        most_explained);
  };
  const auto of_baselines = [&](const BaselineCertificate& of) -> Json {
    return {{"tolerance_px", of.tolerance_px},
            {"pairs", ListJson(of.pairs, of_pair)}};
  };
  const Json json = {{"version", version},
                     {"command", "certificate_checker"},
                     {"baselines", JsonIf(baselines, of_baselines)},
                     {"certificate", JsonIf(certificate, VerdictJson)},
                     {"conflicts", JsonIf(conflicts, of_conflicts)}};
  return ReportText(json);
}

}  // namespace krot::internal
