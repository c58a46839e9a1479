// COLMAP's database: whatever the file holds, what is read is consistent, and
// neither the file nor its folder changes.

#include <algorithm>

#include "krot/database.h"
#include "krot/model.h"
#include "tests/fuzz/fuzz.h"
#include "tests/testing/temp_folder.h"

namespace krot::internal {
namespace {

void Read(const uint8_t* data, size_t size) {
  static const Model model = FuzzScene().model;
  static const TempFolder folder;
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  const auto path = folder / "database.db";
  WriteBytes(path, bytes);
  try {
    const Database database = ReadDatabase(path, model);
    for (const VerifiedPair& pair : database.pairs) {
      Require(pair.image1 != pair.image2, "two images");
      Require(!pair.matches.empty(), "matches");
      for (const auto& [k1, k2] : pair.matches) {
        Require(k1 < database.keypoints[pair.image1].size() &&
                    k2 < database.keypoints[pair.image2].size(),
                "keypoints of every match");
      }
    }
    CheckPairs(model, database);
  } catch (const ModelError&) {
  }
  Require(ReadBytes(path) == bytes, "the same database");
  Require(FileNames(folder.path()).size() == 1, "no other file");
}

}  // namespace
}  // namespace krot::internal

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  krot::internal::Read(data, size);
  return 0;
}
