#include "krot/report/run_record.h"

#include "krot/report/text_table.h"

namespace krot {

std::string RunSentence(const RunRecord& run, const std::string& middle) {
  return "Read " + FormatNumber(run.seconds_read, 2) + " s, " + middle +
         ", wrote " + FormatNumber(run.seconds_write, 2) + " s; " +
         FormatNumber(run.seconds_total, 2) + " s in all on " +
         Counted(run.threads, "thread") + ", " +
         FormatBytes(run.peak_memory_bytes) + " at most.\n";
}

}  // namespace krot
