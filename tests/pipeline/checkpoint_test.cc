// A run that goes on behind the steps of an earlier one, wherever that was
// killed, has the bits of an undisturbed one.

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/base/checkpoint.h"
#include "krot/pipeline/solve_model.h"
#include "krot/synthetic/scene.h"
#include "tests/pipeline/solve_by_ranks.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/temp_folder.h"

namespace krot::internal {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Steps = std::vector<std::string>;

class StepsInMemory : public Checkpoint {
 public:
  explicit StepsInMemory(Steps steps = {}) : steps_(std::move(steps)) {}

  std::optional<std::string> Next() override {
    if (next_ == steps_.size()) return std::nullopt;
    return steps_[next_++];
  }
  void Append(const std::string& record) override {
    steps_.push_back(record);
    next_ = steps_.size();
  }

  const Steps& steps() const { return steps_; }

 private:
  Steps steps_;
  size_t next_ = 0;
};

Solved SolveAlone(const Model& model, SolveModelOptions options,
                  Checkpoint* checkpoint) {
  options.checkpoint = checkpoint;
  SolveModelResult result = SolveModel(model, options, Context{1});
  return {std::move(result.model), std::move(result.summary)};
}

// Long enough for several working sets; lenses, for several rounds.
SceneOptions Street() {
  SceneOptions options = SceneToShare();
  options.layout = SceneLayout::kStreet;
  options.num_frames = 40;
  options.num_points = 4000;
  options.camera_model_id = 4;  // OPENCV
  return options;
}

// Every run that was killed behind some step, gone on with.
void ExpectSameBitsBehindEveryStep(const Model& model,
                                   const SolveModelOptions& options,
                                   size_t least_steps) {
  const Solved undisturbed = SolveAlone(model, options, nullptr);
  StepsInMemory all;
  ExpectSameBits(SolveAlone(model, options, &all), undisturbed);
  ASSERT_GE(all.steps().size(), least_steps);
  for (size_t n = 1; n <= all.steps().size(); ++n) {
    SCOPED_TRACE(n);
    StepsInMemory some({all.steps().begin(), all.steps().begin() + n});
    ExpectSameBits(SolveAlone(model, options, &some), undisturbed);
    EXPECT_EQ(some.steps().size(), all.steps().size());
  }
}

TEST(Checkpoint, HasTheBitsOfAnUndisturbedRunBehindEveryStep) {
  // Sweeps, working sets, proof, and the finish.
  ExpectSameBitsBehindEveryStep(SynthesizeScene(Street()).model, {}, 6);
}

TEST(Checkpoint, HasTheBitsOfAnUndisturbedRunFromNothing) {
  SolveModelOptions options;
  options.init = SolveInit::kFeasible;
  ExpectSameBitsBehindEveryStep(SynthesizeScene(SceneToShare()).model, options,
                                4);
}

TEST(Checkpoint, HasTheBitsOfAnUndisturbedRunBySweepsAlone) {
  SolveModelOptions options;
  options.method = SolveMethod::kResInt;
  ExpectSameBitsBehindEveryStep(SynthesizeScene(Street()).model, options, 2);
}

TEST(Checkpoint, IsTheSameForAnyNumberOfRanks) {
  const Model whole = SynthesizeScene(Street()).model;
  const Solved undisturbed = SolveAlone(whole, {}, nullptr);
  StepsInMemory of_three;
  ExpectSameBits(SolveByRanks(whole, {}, 3, &of_three), undisturbed);
  const Steps& all = of_three.steps();
  for (size_t n = 1; n <= all.size(); ++n) {
    SCOPED_TRACE(n);
    const Steps some(all.begin(), all.begin() + static_cast<int64_t>(n));
    StepsInMemory for_one(some);
    ExpectSameBits(SolveAlone(whole, {}, &for_one), undisturbed);
    StepsInMemory for_two(some);
    ExpectSameBits(SolveByRanks(whole, {}, 2, &for_two), undisturbed);
  }
}

TEST(Checkpoint, KeepsNoStepThatWasCutShort) {
  const Model model = SynthesizeScene(Street()).model;
  SolveModelOptions options;
  CancelFlag cancel = false;
  StepsInMemory steps;
  options.checkpoint = &steps;
  options.joint.callback = [&](int iteration, const JointIteration&) {
    if (iteration == 3) cancel = true;
  };
  Context context{1};
  context.cancel = &cancel;
  EXPECT_EQ(SolveModel(model, options, context).summary.termination,
            SolveTermination::kInterrupted);
  EXPECT_EQ(steps.steps().size(), 1U);  // the sweeps

  StepsInMemory again(steps.steps());
  ExpectSameBits(SolveAlone(model, {}, &again), SolveAlone(model, {}, nullptr));
}

// A disk that is full.
class NoSpace : public Checkpoint {
 public:
  void Append(const std::string&) override {
    throw WriteError("steps: cannot be written: No space left on device");
  }
};

TEST(Checkpoint, ThatCannotBeWrittenEndsNoRun) {
  const Model model = SynthesizeScene(SceneToShare()).model;
  SolveModelOptions options;
  NoSpace full;
  options.checkpoint = &full;
  std::string said;
  Context context{1};
  context.on_note = [&](const std::string& sentence) { said += sentence; };
  SolveModelResult result = SolveModel(model, options, context);
  EXPECT_THAT(said, HasSubstr("going on without checkpoints: steps: cannot be "
                              "written: No space left on device"));
  ExpectSameBits({std::move(result.model), std::move(result.summary)},
                 SolveAlone(model, {}, nullptr));
}

class CheckpointFileTest : public ::testing::Test {
 protected:
  CheckpointFileTest() : file_((folder_ / "steps").string()) {}

  Steps StepsIn() const {
    CheckpointFile checkpoint(file_, run_);
    Steps steps;
    while (std::optional<std::string> step = checkpoint.Next()) {
      steps.push_back(*std::move(step));
    }
    EXPECT_EQ(checkpoint.num_steps(), static_cast<int64_t>(steps.size()));
    return steps;
  }
  void Append(const std::string& step) const {
    CheckpointFile checkpoint(file_, run_);
    while (checkpoint.Next()) {
    }
    checkpoint.Append(step);
  }
  std::string Refusal() const {
    return MessageOf<CheckpointError>([&] { CheckpointFile(file_, run_); });
  }

  TempFolder folder_;
  const std::string file_;
  const std::string run_ = std::string(64, 'a');
};

TEST_F(CheckpointFileTest, GivesTheStepsInTheirOrder) {
  Append("one");
  Append("");
  Append("three");
  EXPECT_THAT(StepsIn(), ElementsAre("one", "", "three"));
}

TEST_F(CheckpointFileTest, HasTheWholeStepsOfAnyBeginning) {
  Append("one");
  const size_t behind_one = ReadBytes(file_).size();
  Append("two");
  const std::string whole = ReadBytes(file_);
  for (size_t size = 0; size < whole.size(); ++size) {
    SCOPED_TRACE(size);
    WriteBytes(file_, whole.substr(0, size));
    const bool has_one = size >= behind_one;
    EXPECT_EQ(StepsIn(), has_one ? Steps{"one"} : Steps{});
    Append("next");
    EXPECT_EQ(StepsIn(), has_one ? (Steps{"one", "next"}) : Steps{"next"});
  }
}

TEST_F(CheckpointFileTest, GivesUpWhatStandsBehindAChangedByte) {
  Append("one");
  const size_t behind_one = ReadBytes(file_).size();
  Append("two");
  const std::string whole = ReadBytes(file_);
  for (size_t n = behind_one; n < whole.size(); ++n) {
    std::string changed = whole;
    changed[n] = static_cast<char>(changed[n] ^ 1);
    WriteBytes(file_, changed);
    EXPECT_THAT(StepsIn(), ElementsAre("one")) << n;
  }
}

TEST_F(CheckpointFileTest, RefusesTheStepsOfAnotherRun) {
  CheckpointFile(file_, std::string(64, 'b')).Append("one");
  EXPECT_EQ(Refusal(), file_ +
                           ": this checkpoint is of another run: model, "
                           "options or version of KROT differ; remove it, or "
                           "name another file");
}

TEST_F(CheckpointFileTest, RefusesAnyOtherFileAndLeavesIt) {
  WriteBytes(file_, "a week's work");
  EXPECT_EQ(Refusal(), file_ + ": this is no checkpoint of KROT");
  EXPECT_EQ(ReadBytes(file_), "a week's work");
}

TEST_F(CheckpointFileTest, IsForOneRunAtATime) {
  const CheckpointFile first(file_, run_);
  EXPECT_EQ(Refusal(), file_ + ": another run writes this checkpoint");
}

TEST(StepValues, RefuseARecordOfOtherValues) {
  StepValues written(nullptr);
  std::vector<double> two = {1, 2};
  written.Values(&two);
  const auto read = [](const std::string& record, int count) {
    StepValues values(record, nullptr);
    std::vector<double> any;
    for (int n = 0; n < count; ++n) values.Values(&any);
    values.RequireEnd();
    return any;
  };
  EXPECT_EQ(read(written.record(), 1), two);
  EXPECT_THROW(read(written.record(), 0), CheckpointError);
  EXPECT_THROW(read(written.record(), 2), CheckpointError);
  EXPECT_THROW(read(written.record().substr(1), 1), CheckpointError);
}

}  // namespace
}  // namespace krot::internal
