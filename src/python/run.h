#pragma once

#include <functional>

#include "krot/base/context.h"

namespace krot::internal {

// Runs `work` on a thread of its own with the GIL released, and meanwhile looks
// for Ctrl-C: then cancels it, waits until it ends, and throws what the signal
// raises. Exceptions of `work` come out. Needs the GIL, and has it in the end.
void RunInterruptibly(const std::function<void(const CancelFlag&)>& work);

}  // namespace krot::internal
