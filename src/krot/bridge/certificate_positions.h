#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "krot/bridge/bridge.h"
#include "krot/bridge/certificate_file.h"
#include "krot/model.h"
#include "krot/model/positions_file.h"

namespace krot::internal {

// Positions within a radius as the file of a certificate has them.

// Why they are none; empty if they are.
std::string RefusalOfPositions(const Model& model, const CertificateFile& file);

// The same in terms of the model; requires that there is no refusal.
std::vector<KnownPosition> KnownPositionsOf(const Model& model,
                                            const CertificateFile& file);

// Their rows, by what the problem calls them that was built with these. One
// that it does not have, of an image or point without observations in the
// problem, is missed by the proof's balance.
class CertificatePositions {
 public:
  // Keeps references.
  CertificatePositions(const Model& model, const CertificateFile& file,
                       const BuiltProblem& built);

  // That of a position's observation; none if the file has less rows.
  const CertificateFile::Position::Row* RowOf(int64_t observation) const;

 private:
  const BuiltProblem& built_;
  std::vector<const CertificateFile::Position*> positions_;
};

}  // namespace krot::internal
