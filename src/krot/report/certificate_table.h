#pragma once

#include <string>
#include <vector>

#include "krot/bridge/certificate_verdict.h"

namespace krot {

// The first `max_positions` known positions of a support; empty without any.
std::string PositionsTable(const std::vector<SupportPosition>& positions,
                           int max_positions);

// The `max_observations` worst of a support.
std::string SupportTable(const std::vector<SupportObservation>& support,
                         int max_observations);

// An accepted certificate as a text for the terminal: the bound, the model's
// own cost and gap, and the `max_observations` worst of the support.
std::string CertificateTable(const CertificateVerdict& verdict,
                             int max_observations);

}  // namespace krot
