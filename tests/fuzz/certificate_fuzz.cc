// Certificates and conflicts: none that is accepted claims more than the truth,
// which is the largest error of an estimate that a solve has found.

#include <algorithm>

#include "krot/context.h"
#include "krot/convert/certificate_file.h"
#include "krot/pipeline/solve_model.h"
#include "tests/fuzz/fuzz.h"

namespace krot::internal {
namespace {

struct Truth {
  Truth() {
    SolveModelOptions options;
    options.finish.finish = Finish::kNone;
    options.describe_certificate = true;
    const SolveModelResult result = SolveModel(model, options, {1});
    cost = result.summary.cost_final;
    certificate = *result.summary.certificate;
  }

  Model model = FuzzScene().model;
  double cost = 0;  // no bound is above it
  CertificateFile certificate;
};

void JudgeText(const std::string& json) {
  static const Truth truth;
  try {
    if (HoldsConflicts(json)) {
      VerifyConflictFile(truth.model, ParseConflicts(json, "file"));
      return;
    }
    CertificateFile file = ParseCertificate(json, "file");
    // Of any other model it is refused at once.
    file.model_sha256 = truth.certificate.model_sha256;
    const CertificateVerdict verdict = VerifyCertificateFile(truth.model, file);
    if (!verdict.is_accepted || file.norm.p != truth.certificate.norm.p) return;
    const bool moves_all =
        verdict.num_fixed_images + verdict.num_fixed_points == 0;
    Require(!moves_all || verdict.lower_bound <= truth.cost * (1 + 1e-9),
            "no bound above an error that an estimate has");
  } catch (const ModelError&) {
  }
}

// Changes the numbers of the true certificate, which as JSON keeps its form.
void Tamper(ByteSource source) {
  static const Truth truth;
  CertificateFile file = truth.certificate;
  while (!source.IsEmpty()) {
    auto& o = file.observations[source.Byte() % file.observations.size()];
    const double value = source.Take<double>();
    switch (source.Byte() % 9) {
      case 0:
        o.lambda = value;
        break;
      case 1:
        o.lambda *= value;
        break;
      case 2:
        o.y[0] = value;
        break;
      case 3:
        o.y[1] += value;
        break;
      case 4:
        o.bearing[source.Byte() % 3] += value;
        break;
      case 5:
        o.point2D_idx ^= source.Byte();
        break;
      case 6:
        file.lower_bound *= value;
        break;
      case 7:
        file.rows_bound *= value;
        break;
      default:
        file.defect = value;
        break;
    }
  }
  JudgeText(CertificateJson(file));
}

}  // namespace
}  // namespace krot::internal

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  krot::internal::ByteSource source(data, size);
  if (source.Byte() == 'T') {
    krot::internal::Tamper(source);
  } else {
    krot::internal::JudgeText(
        std::string(reinterpret_cast<const char*>(data), size));
  }
  return 0;
}
