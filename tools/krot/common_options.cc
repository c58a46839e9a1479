#include "tools/krot/common_options.h"

namespace krot {

void AddCommonOptions(const std::string& seed_description,
                      CommonOptions* options, OptionParser* parser) {
  parser->Add({"random_seed", seed_description, "an integer >= 0",
               std::to_string(options->random_seed), false,
               [options](const std::string& text) {
                 return ParseInteger(text, &options->random_seed);
               }});
  parser->AddInteger("log_level", &options->log.level, Between(0, 2),
                     "What to say on stderr: 0 errors only, 1 progress, 2 "
                     "details");
  parser->AddBool("log_to_stderr", &options->log.to_stderr,
                  "Send the tables to stderr, too, and leave stdout empty");
  parser->AddPath("project_path", &options->project_path, false, "an .ini file",
                  "Options in COLMAP's manner: name = value, groups in "
                  "[Sections]; explicit flags win");
}

}  // namespace krot
