#pragma once

#include <string>
#include <vector>

namespace krot::internal {

// The commands of `krot_benchmark`, one .cc file each. They return an exit code
// or throw an exception that krot_benchmark.cc turns into one.
int RunTriangulationBenchmark(const std::vector<std::string>& arguments);
int RunBlocksBenchmark(const std::vector<std::string>& arguments);
int RunKnownRotationBenchmark(const std::vector<std::string>& arguments);
int RunSweepBenchmark(const std::vector<std::string>& arguments);
int RunScalingBenchmark(const std::vector<std::string>& arguments);
int RunJointBenchmark(const std::vector<std::string>& arguments);
int RunPositioningBenchmark(const std::vector<std::string>& arguments);
int RunSummaryBenchmark(const std::vector<std::string>& arguments);

}  // namespace krot::internal
