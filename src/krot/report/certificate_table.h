#pragma once

#include <string>

#include "krot/bridge/certificate_verdict.h"

namespace krot {

// An accepted certificate as a text for the terminal: the bound, the model's
// own cost and gap, and the `max_observations` worst of the support.
std::string CertificateTable(const CertificateVerdict& verdict,
                             int max_observations);

}  // namespace krot
