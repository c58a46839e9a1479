#include "krot/report/certificate_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "krot/report/text_table.h"

namespace krot {
namespace {

std::string Scientific(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1e", value);
  return text;
}

}  // namespace

std::string CertificateTable(const CertificateVerdict& verdict,
                             int max_observations) {
  TextTable bounds;
  // Downwards: more than this is not claimed.
  bounds.AddRow({"lower bound",
                 FormatNumber(std::floor(verdict.lower_bound * 1e6) / 1e6, 6)});
  bounds.AddRow({"this model", FormatNumber(verdict.cost, 6)});
  bounds.AddRow({"relative gap", Scientific(verdict.relative_gap)});

  const size_t count =
      std::min(verdict.support.size(), static_cast<size_t>(max_observations));
  TextTable support;
  support.AddRow({"image", "point2D_idx", "point3D_id", "multiplier", "error"});
  for (size_t n = 0; n < count; ++n) {
    const CertificateVerdict::SupportObservation& o = verdict.support[n];
    support.AddRow({o.image_name, std::to_string(o.point2D_idx),
                    std::to_string(o.point3D_id), FormatNumber(o.multiplier, 6),
                    FormatNumber(o.error_px, 4)});
  }
  return "The certificate holds: whatever the translations and points, the "
         "largest error is at least\nthe lower bound. Linearised pixels\n" +
         bounds.ToString() + "\nThe support, which alone sets it: " +
         Counted(static_cast<int64_t>(verdict.support.size()), "observation") +
         ", worst first\n" + support.ToString();
}

}  // namespace krot
