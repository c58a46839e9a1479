#pragma once

#include <string>
#include <vector>

namespace krot::internal {

// The commands of `krot`, one .cc file each. They return an exit code, or throw
// an exception that krot.cc turns into one.
int RunSolver(const std::vector<std::string>& arguments);
int RunBundleAdjuster(const std::vector<std::string>& arguments);
int RunPointTriangulator(const std::vector<std::string>& arguments);
int RunOutlierFilter(const std::vector<std::string>& arguments);
int RunToleranceAnalyzer(const std::vector<std::string>& arguments);
int RunModelAnalyzer(const std::vector<std::string>& arguments);
int RunModelChecker(const std::vector<std::string>& arguments);
int RunModelComparer(const std::vector<std::string>& arguments);
int RunCertificateChecker(const std::vector<std::string>& arguments);
int RunModelSynthesizer(const std::vector<std::string>& arguments);

}  // namespace krot::internal
