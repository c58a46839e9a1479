#pragma once

#include <string>

#include "krot/base/context.h"

namespace krot::internal {

// What SIGINT and SIGTERM do.

// From now on they end the process at once, with a sentence of `who` and
// kExitInterrupted: for as long as nothing has been written.
void EndOnInterrupt(const std::string& who);

// From now on the first one sets the returned flag, so that what has begun is
// completed, or cut short by who looks at it; a second one ends the process at
// once.
const CancelFlag& DeferInterrupts();

// Sets that flag.
void Interrupt();

}  // namespace krot::internal
