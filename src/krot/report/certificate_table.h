#pragma once

#include <optional>
#include <string>
#include <vector>

#include "krot/bridge/baseline_certificate.h"
#include "krot/bridge/certificate_verdict.h"
#include "krot/bridge/conflict_file.h"

namespace krot::internal {

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

// Of an accepted certificate of baselines the `max_pairs` pairs of which the
// least share is explained.
std::string BaselineTable(const Model& model,
                          const BaselineCertificate& certificate,
                          int max_pairs);

// What certificate_checker says of an accepted file of conflicts.
std::string ConflictTable(const ConflictVerdict& verdict);

// report.json of certificate_checker for what it accepted: one of the three.
std::string CheckJson(const std::optional<CertificateVerdict>& certificate,
                      const std::optional<ConflictVerdict>& conflicts,
                      const std::optional<BaselineCertificate>& baselines,
                      const std::string& version);

}  // namespace krot::internal
