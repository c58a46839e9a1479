#include "krot/report/run_record.h"

#include "krot/base/parallel_for.h"
#include "krot/report/peak_memory.h"
#include "krot/report/text_table.h"
#include "krot/version.h"

namespace krot::internal {

void RecordEnd(const Timer& timer, int num_threads, RunRecord* run) {
  run->version = KROT_VERSION;
  run->threads = ResolveNumThreads(num_threads);
  run->seconds_total = timer.Seconds();
  run->peak_memory_bytes = PeakMemoryBytes();
}

std::string RunSentence(const RunRecord& run, const std::string& middle) {
  return "Read " + FormatNumber(run.seconds_read, 2) + " s, " + middle +
         ", wrote " + FormatNumber(run.seconds_write, 2) + " s; " +
         FormatNumber(run.seconds_total, 2) + " s in all on " +
         Counted(run.threads, "thread") + ", " +
         FormatBytes(run.peak_memory_bytes) + " at most.\n";
}

}  // namespace krot::internal
