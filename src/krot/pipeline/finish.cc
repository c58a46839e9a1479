#include "krot/pipeline/finish.h"

namespace krot::internal {

const char* FinishName(Finish finish) {
  switch (finish) {
    case Finish::kSweeps:
      return "sweeps";
    case Finish::kLeastSquares:
      return "least_squares";
    case Finish::kNone:
      break;
  }
  return "none";
}

}  // namespace krot::internal
