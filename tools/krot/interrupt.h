#pragma once

#include "krot/base/progress.h"

namespace krot {

// From now on the first SIGINT or SIGTERM sets the returned flag; a second
// one ends the process at once.
const CancelFlag& CatchInterrupts();

// Throws CommandError (kExitInterrupted) if the flag is set.
void ThrowIfInterrupted();

}  // namespace krot
