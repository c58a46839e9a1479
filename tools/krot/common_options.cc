#include "tools/krot/common_options.h"

#include "tools/krot/run_log.h"

namespace krot::internal {

void AddLogLevel(LogOptions* log, OptionParser* parser) {
  parser->AddInteger("log_level", &log->level, Between(0, 2),
                     "What to say on stderr: 0 errors only, 1 progress, 2 "
                     "details");
}

void AddProjectPath(std::string* project_path, OptionParser* parser) {
  parser->AddPath("project_path", project_path, false, "an .ini file",
                  "Options in COLMAP's manner: name = value, groups in "
                  "[Sections]; the command line wins");
}

void AddCommonOptions(CommonOptions* options, OptionParser* parser,
                      const char* of_seed) {
  parser->Add({"random_seed", of_seed, "an integer >= 0",
               std::to_string(options->random_seed), false,
               [options](const std::string& text) {
                 return ParseInteger(text, &options->random_seed);
               }});
  AddLogLevel(&options->log, parser);
  parser->AddOutputFile(
      "log_path", &options->log.path,
      "Where a log goes with all that is needed to repeat the run: version, "
      "machine, options, digests of the inputs, every line");
  parser->AddBool("log_to_stderr", &options->log.to_stderr,
                  "Print the tables on stderr, not on stdout");
  AddProjectPath(&options->project_path, parser);
  parser->OnParsed([options, parser] {
    if (!options->log.path.empty()) BeginRunLog(options->log.path, *parser);
  });
}

}  // namespace krot::internal
