#pragma once

namespace krot {

// Has BLAS keep to the thread that calls it, for the whole process and from now
// on: OpenBLAS, MKL and BLIS can be built with threads of their own, which
// would compete with ours. Any other is taken to have none.
void UseOneBlasThread();

}  // namespace krot
