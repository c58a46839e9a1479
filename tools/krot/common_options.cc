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
                  "[Sections]; explicit flags win");
}

void AddCommonOptions(const std::string& seed_description,
                      CommonOptions* options, OptionParser* parser) {
  parser->Add({"random_seed", seed_description, "an integer >= 0",
               std::to_string(options->random_seed), false,
               [options](const std::string& text) {
                 return ParseInteger(text, &options->random_seed);
               }});
  AddLogLevel(&options->log, parser);
  parser->AddOutputFile("log_path", &options->log.path,
                        "Where a log of this run goes, whatever the level: "
                        "version, machine, every option, the digests of what "
                        "was read, each line; all that is needed to repeat it");
  parser->AddBool("log_to_stderr", &options->log.to_stderr,
                  "Send the tables to stderr, too, and leave stdout empty");
  AddProjectPath(&options->project_path, parser);
  parser->OnParsed([options, parser] {
    if (!options->log.path.empty()) BeginRunLog(options->log.path, *parser);
  });
}

}  // namespace krot::internal
