#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/ranks.h"
#include "krot/base/write_file.h"

namespace krot {

// A checkpoint that cannot be used; what() is one sentence.
class CheckpointError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The steps that a run has completed, in their order. Runs are deterministic:
// the same one, begun anew after it was killed, takes all decisions again and
// comes to the same steps, whose results it takes from here (RunStep), so that
// it ends with the same bits. This one keeps nothing: of ranks, all but the
// first one have such.
class Checkpoint {
 public:
  virtual ~Checkpoint() = default;

  // What the next step came to; none behind the last one that was completed,
  // and from then on.
  virtual std::optional<std::string> Next() { return std::nullopt; }

  // Behind all that Next has given. Throws WriteError if it is not kept.
  virtual void Append(const std::string& /*record*/) {}
};

// What a step changes: one function names the values, in the same order when
// they are written as when they are read. T holds no pointer.
class StepValues {
 public:
  // Writes. Where ranks share the points they name their values together.
  explicit StepValues(Ranks* ranks) : ranks_(ranks) {}
  // Reads; of ranks the first one has the record.
  StepValues(std::string record, Ranks* ranks)
      : ranks_(ranks), is_read_(true), record_(std::move(record)) {}

  // The same on every rank.
  template <typename T>
  void Value(T* value) {
    struct Boxed {  // vectors of bool are no plain values
      T value;
    };
    std::vector<Boxed> boxed = {{*value}};
    Values(&boxed);
    if (is_read_) *value = boxed.at(0).value;
  }
  template <typename T>
  void Values(std::vector<T>* values) {
    OnFirst(values);
    if (is_read_ && ranks_ != nullptr) ranks_->Broadcast(values);
  }
  // Whether it is there is the same on every rank; then `describe` names what
  // it holds.
  template <typename T, typename Describe>
  void Optional(std::optional<T>* value, const Describe& describe) {
    bool is_there = value->has_value();
    Value(&is_there);
    if (!is_there) return value->reset();
    if (!*value) value->emplace();
    describe(&**value);
  }

  // Of points: every rank has its share, and the same when it reads. The record
  // does not depend on how many share them.
  template <typename T>
  void Shared(std::vector<T>* values) {
    if (ranks_ == nullptr) return OnFirst(values);
    if (!is_read_) {
      std::vector<T> all = ranks_->GatherOnFirst(*values);
      return OnFirst(&all);
    }
    const std::vector<int64_t> sizes = ranks_->Gather(
        std::vector<int64_t>{static_cast<int64_t>(values->size())});
    std::vector<std::vector<T>> to(ranks_->count());
    if (ranks_->IsFirst()) {
      std::vector<T> all;
      OnFirst(&all);
      auto begin = all.begin();
      for (int r = 0; r < ranks_->count(); ++r) {
        to[r].assign(begin, begin + sizes[r]);
        begin += sizes[r];
      }
    }
    *values = std::move(ranks_->ExchangeValues(std::move(to))[0]);
  }

  // Only the first rank's counts, and only it has it back.
  template <typename T>
  void OnFirst(std::vector<T>* values) {
    if (ranks_ != nullptr && !ranks_->IsFirst()) return;
    auto size = static_cast<uint64_t>(values->size());
    Bytes(&size, sizeof(size));
    if (is_read_) {
      Require(size <= (record_.size() - offset_) / sizeof(T));
      values->resize(size);
    }
    if (size > 0) Bytes(values->data(), size * sizeof(T));
  }

  const std::string& record() const { return record_; }

  // Throws CheckpointError if more was written than is read.
  void RequireEnd() const { Require(offset_ == record_.size()); }

 private:
  static void Require(bool fits) {
    if (fits) return;
    throw CheckpointError(
        "the checkpoint is of another build of KROT: its steps hold other "
        "values; remove it");
  }
  void Bytes(void* bytes, size_t size) {
    if (!is_read_) {
      record_.append(static_cast<const char*>(bytes), size);
      return;
    }
    Require(size <= record_.size() - offset_);
    std::memcpy(bytes, record_.data() + offset_, size);
    offset_ += size;
  }

  Ranks* const ranks_;
  const bool is_read_ = false;
  std::string record_;
  size_t offset_ = 0;
};

// Computes, and keeps what `describe(StepValues*)` names of it unless the run
// is cut short; or takes that from the checkpoint and computes nothing. Without
// a checkpoint (null) it computes. Every rank must call it, all with or all
// without one. A step that cannot be kept ends no run.
template <typename Compute, typename Describe>
void RunStep(Checkpoint* checkpoint, const Context& context,
             const Compute& compute, const Describe& describe) {
  if (checkpoint == nullptr) return compute();
  std::optional<std::string> record = checkpoint->Next();
  if (context.Any(record.has_value())) {
    StepValues values(std::move(record).value_or(""), context.ranks);
    describe(&values);
    return values.RequireEnd();
  }
  compute();
  if (context.Any(context.IsCancelled())) return;
  StepValues values(context.ranks);
  describe(&values);
  try {
    checkpoint->Append(values.record());
  } catch (const WriteError& error) {
    context.Note(std::string("going on without checkpoints: ") + error.what());
  }
}

}  // namespace krot
