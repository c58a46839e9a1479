#pragma once

#include <functional>

#include "krot/base/context.h"

namespace krot::internal {

// Runs `work` on a thread of its own with the GIL released, and watches for
// Ctrl-C. On Ctrl-C it cancels the work, waits until it ends, and throws what
// the signal raises. Rethrows exceptions of `work`. The caller must hold the
// GIL, and holds it again at the end.
void RunInterruptibly(const std::function<void(const CancelFlag&)>& work);

}  // namespace krot::internal
