#pragma once

#include <optional>

#include "krot/base/checkpoint.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/proof/certificate.h"

namespace krot::internal {

// What steps have in common.

inline void NameValues(StepValues* values, Estimate* estimate) {
  values->Values(&estimate->translations);
  values->Shared(&estimate->points);
}

inline void NameValues(StepValues* values,
                       std::optional<Certificate>* certificate) {
  values->Optional(certificate, [&](Certificate* c) {
    values->Value(&c->lower_bound);
    values->Value(&c->defect);
    values->Values(&c->observations);
  });
}

}  // namespace krot::internal
