// For builds without SQLite: databases can be neither read nor written.

#include "krot/database.h"
#include "krot/model.h"
#include "krot/model/model_io.h"

namespace krot {

using namespace internal;

Database ReadDatabase(const std::filesystem::path& path, const Model&,
                      const FileNote&) {
  throw ModelError(path.string() +
                   ": cannot be read by this build, which has no SQLite");
}

void WriteDatabase(const std::filesystem::path& path, const Model&,
                   const Database&) {
  throw WriteError(path.string() +
                   ": cannot be written by this build, which has no SQLite");
}

namespace internal {

std::vector<KnownPosition> ReadPosePriors(const std::filesystem::path& path,
                                          const Model&,
                                          const PositionsOptions&) {
  throw ModelError(path.string() +
                   ": cannot be read by this build, which has no SQLite");
}

}  // namespace internal

}  // namespace krot
