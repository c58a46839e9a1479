#include "krot/pipeline/finish.h"

namespace krot::internal {

const char* FinishName(Finish finish) {
  return finish == Finish::kNone ? "none" : "least_squares";
}

}  // namespace krot::internal
