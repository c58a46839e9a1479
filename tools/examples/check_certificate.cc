// check_certificate MODEL_FOLDER CERTIFICATE: whether the file of
// `krot solver --certificate_path` proves its bound for this model.

#include <cstdio>
#include <exception>

#include "krot/certificate.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "Usage: %s MODEL_FOLDER CERTIFICATE\n", argv[0]);
    return 1;
  }
  try {
    const krot::Model model = krot::ReadModel(argv[1]);
    const krot::CertificateVerdict verdict =
        krot::VerifyCertificate(model, krot::ReadCertificate(argv[2]));
    if (!verdict.is_accepted) {
      std::printf("rejected: %s\n", verdict.refusal.c_str());
      return 1;
    }
    std::printf("proved: no positions bring the largest error below %.6f px\n",
                verdict.lower_bound);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
