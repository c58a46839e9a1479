#include "tests/end_to_end/comparison.h"

#include <nlohmann/json.hpp>

#include "tests/end_to_end/script.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {

namespace fs = std::filesystem;
using Json = nlohmann::json;

Comparison CompareWithTruth(const fs::path& model, const fs::path& truth,
                            const fs::path& output) {
  const KrotResult run =
      RunScript("compare_linf_with_ba.sh",
                {"--input_path", model.string(), "--truth_path", truth.string(),
                 "--output_path", output.string()});
  Comparison comparison;
  comparison.exit_code = run.exit_code;
  comparison.table = run.out;
  comparison.words = run.err;
  if (run.exit_code != 0) return comparison;

  const fs::path reports = output / "reports";
  const fs::path certificate = reports / "certificate.json";
  if (fs::exists(certificate)) {
    comparison.lower_bound =
        Json::parse(ReadBytes(certificate))["lower_bound"].get<double>();
  }
  for (const char* name : {"input", "colmap_ba", "ba", "cauchy", "ba_rotations",
                           "bounded", "linf", "linf_cauchy", "linf_only"}) {
    const Json report =
        Json::parse(ReadBytes(reports / (std::string(name) + ".json")));
    const Json& errors = report["pixel_error"]["model2"];
    comparison.scene_radius = report["scene_radius"];
    comparison.results[name] = {errors["max"], errors["rms"],
                                report["center"]["rms"],
                                report["center"]["max"]};
  }
  return comparison;
}

}  // namespace krot::internal
