#include "krot/model/name_list.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/base/numbers.h"

namespace krot::internal {
namespace {

constexpr int32_t kAmbiguous = -1;  // several images have the name
constexpr std::string_view kSeparators = " \t\r;\",";

std::string Quoted(std::string_view text) {
  return "\"" + std::string(text) + "\"";
}

std::string_view Trimmed(std::string_view text) {
  const size_t begin = text.find_first_not_of(kSeparators);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kSeparators) + 1 - begin);
}

// Cuts the last word off the text; "" if there is none.
std::string_view TakeLast(std::string_view separators, std::string_view* text) {
  *text = text->substr(0, text->find_last_not_of(separators) + 1);
  const size_t begin = text->find_last_of(separators) + 1;
  const std::string_view word = text->substr(begin);
  *text = text->substr(0, begin);
  return word;
}

bool HasNumber(std::string_view line) {
  while (!line.empty()) {
    if (TextReader::ParseNumber<double>(TakeLast(kSeparators, &line))) {
      return true;
    }
  }
  return false;
}

// Whether one of the numbers at the end has a decimal comma, like 4,99. A comma
// that separates numbers differs: then a word has several commas, or one at its
// end.
bool HasDecimalComma(std::string_view line) {
  for (;;) {
    const std::string_view word = TakeLast(" \t\r;\"", &line);
    if (word.empty() ||
        word.find_first_not_of("0123456789+-.,eE") != std::string_view::npos) {
      return false;
    }
    const size_t comma = word.find(',');
    if (comma != std::string_view::npos && comma > 0 &&
        comma + 1 < word.size() && comma == word.rfind(',')) {
      return true;
    }
  }
}

}  // namespace

ListReader::ListReader(const FileBytes& file, const Model& model, Of of)
    : file_(file),
      model_(model),
      of_(of),
      reader_(file),
      image_ids_(model.images),
      point_ids_(model.points3D),
      line_of_(of == Of::kPoints3D ? model.points3D.size()
                                   : model.images.size()) {
  for (size_t n = 0; n < model.images.size(); ++n) {
    const auto [image, is_new] =
        image_of_name_.emplace(model.images[n].name, static_cast<int32_t>(n));
    if (!is_new) image->second = kAmbiguous;
  }
}

std::optional<int32_t> ListReader::FindPoint(std::string_view name) const {
  const auto id = TextReader::ParseNumber<Point3DId>(name);
  return id ? point_ids_.Find(*id) : std::nullopt;
}

std::optional<int32_t> ListReader::Find(std::string_view name) const {
  if (of_ == Of::kPoints3D) return FindPoint(name);
  auto image = image_of_name_.find(name);
  std::string path(name);
  std::replace(path.begin(), path.end(), '\\', '/');
  std::string_view rest = path;
  while (image == image_of_name_.end()) {
    image = image_of_name_.find(rest);
    const size_t slash = rest.find('/');
    if (slash == std::string_view::npos) break;
    rest.remove_prefix(slash + 1);
  }
  if (image == image_of_name_.end()) {
    const auto id = TextReader::ParseNumber<ImageId>(name);
    return of_ == Of::kImagesOrIds && id ? image_ids_.Find(*id) : std::nullopt;
  }
  if (image->second == kAmbiguous) {
    reader_.Fail(Quoted(name) + ", which several images of the model bear",
                 "the name of one");
  }
  return image->second;
}

std::optional<int32_t> ListReader::TakeName() {
  ++num_lines_;
  const std::string_view name = Trimmed(reader_.Rest());
  const std::optional<int32_t> index = Find(name);
  if (index) {
    NotePath(name, *index);
  } else {
    skipped_.Add(std::string(name));
  }
  return index;
}

std::optional<ListReader::Line> ListReader::Take(
    const std::vector<size_t>& counts, const std::string& expected) {
  const std::string_view line = reader_.Rest();
  if (num_lines_ == 0 && header_.empty() && !HasNumber(line) &&
      !Find(Trimmed(line))) {
    header_ = line;
    return std::nullopt;
  }
  ++num_lines_;
  if (HasDecimalComma(line)) reader_.FailAtNumber<double>(line, expected);
  // The numbers at the end of the line, last one first, and for each count of
  // numbers what stands in front of them.
  std::vector<double> numbers;
  std::string_view front = line;
  std::vector<std::string_view> names = {Trimmed(front)};
  while (numbers.size() < counts.front()) {
    const std::string_view word = TakeLast(kSeparators, &front);
    const auto number = TextReader::ParseNumber<double>(word);
    if (!number && numbers.size() < counts.back()) {
      reader_.Fail(word.empty() ? "the end of the line" : Quoted(word),
                   "a finite number: " + expected);
    }
    if (!number) break;
    numbers.push_back(*number);
    names.push_back(Trimmed(front));
  }
  const auto take = [&](size_t count) -> std::optional<Line> {
    numbers.resize(count);
    return TakeNumbers(names[count], {numbers.rbegin(), numbers.rend()},
                       expected);
  };
  std::optional<std::string_view> unknown;
  for (const size_t count : counts) {
    if (count > numbers.size()) continue;
    if (Find(names[count])) return take(count);
    if (!unknown) unknown = names[count];
  }
  for (size_t count = 1; count <= numbers.size(); ++count) {
    if (!Find(names[count])) continue;
    reader_.Fail(
        std::to_string(count) + " numbers behind " + Described(names[count]),
        expected);
  }
  if (unknown->empty()) reader_.Fail("no name", "one in front of " + expected);
  skipped_.Add(std::string(*unknown));
  return std::nullopt;
}

// Names may contain blanks, so every place where they may be split is tried
// until both halves are known.
std::optional<std::array<KnownDistance::End, 2>> ListReader::FindPair(
    std::string_view names) const {
  const auto find =
      [&](std::string_view name) -> std::optional<KnownDistance::End> {
    if (name.empty()) return std::nullopt;
    if (const auto image = Find(name)) return KnownDistance::End{true, *image};
    if (const auto point = FindPoint(name)) {
      return KnownDistance::End{false, *point};
    }
    return std::nullopt;
  };
  for (size_t gap = names.find_first_of(kSeparators);
       gap != std::string_view::npos;
       gap = names.find_first_of(kSeparators, gap + 1)) {
    const auto first = find(Trimmed(names.substr(0, gap)));
    const auto second = find(Trimmed(names.substr(gap)));
    if (!first || !second) continue;
    if (first->is_image == second->is_image && first->index == second->index) {
      reader_.Fail(Quoted(names) + ", the same twice", "two that differ");
    }
    return std::array{*first, *second};
  }
  return std::nullopt;
}

std::optional<ListReader::PairLine> ListReader::TakePair(
    size_t count, bool may_lack_numbers, const std::string& expected) {
  const std::string_view line = reader_.Rest();
  if (HasDecimalComma(line)) reader_.FailAtNumber<double>(line, expected);
  PairLine pair;
  std::string_view front = line;
  while (pair.numbers.size() < count) {
    const auto number =
        TextReader::ParseNumber<double>(TakeLast(kSeparators, &front));
    if (!number) break;
    pair.numbers.insert(pair.numbers.begin(), *number);
  }
  const bool has_numbers = pair.numbers.size() == count;
  std::optional<std::array<KnownDistance::End, 2>> ends;
  if (has_numbers) ends = FindPair(Trimmed(front));
  if (!ends && may_lack_numbers) {
    ends = FindPair(Trimmed(line));
    if (ends) pair.numbers.clear();
  }
  if (!ends && num_lines_ == 0 && header_.empty() && !HasNumber(line)) {
    header_ = line;
    return std::nullopt;
  }
  ++num_lines_;
  const bool is_in_front =
      has_numbers && !(may_lack_numbers && Trimmed(front).empty());
  const std::string_view names = Trimmed(is_in_front ? front : line);
  if (!ends && ((!has_numbers && (!may_lack_numbers || HasNumber(line))) ||
                names.find_first_of(kSeparators) == std::string_view::npos)) {
    reader_.Fail(Quoted(Trimmed(line)), expected);
  }
  if (!ends) {
    skipped_.Add(std::string(names));
    return std::nullopt;
  }
  for (const double number : pair.numbers) {
    if (!std::isfinite(number)) {
      reader_.Fail(Quoted(Trimmed(line)), "finite numbers: " + expected);
    }
  }
  pair.ends = *ends;
  return pair;
}

ListReader::Line ListReader::TakeNumbers(std::string_view name,
                                         std::vector<double> numbers,
                                         const std::string& expected) {
  const int32_t index = *Find(name);
  size_t& line = line_of_[index];
  if (line > 0) {
    reader_.Fail(Described(NameOf(index)) + " again",
                 "each once; line " + std::to_string(line) + " names it");
  }
  line = reader_.line_number();
  NotePath(name, index);
  for (const double number : numbers) {
    if (std::isfinite(number)) continue;
    std::string text;
    AppendNumber(number, &text);
    reader_.Fail(Quoted(text), "a finite number: " + expected);
  }
  return {index, std::move(numbers)};
}

void ListReader::NotePath(std::string_view name, int32_t index) {
  if (of_ == Of::kPoints3D || name.find_first_of("/\\") == std::string::npos) {
    return;
  }
  const std::string& own = model_.images[index].name;
  if (name != own) paths_.Add(Quoted(name) + " for " + Quoted(own));
}

std::string ListReader::Described(std::string_view name) const {
  if (of_ == Of::kPairs) return Quoted(name);
  return of_ == Of::kPoints3D ? "3D point " + std::string(name)
                              : "image " + Quoted(name);
}

std::string ListReader::NameOf(int32_t index) const {
  return of_ == Of::kPoints3D ? std::to_string(model_.points3D[index].id)
                              : model_.images[index].name;
}

void ListReader::Finish(const FileNote& note) const {
  const std::string kind = of_ == Of::kPoints3D ? "3D point"
                           : of_ == Of::kPairs  ? "pair"
                                                : "image";
  if (num_lines_ == 0) {
    throw ModelError(file_.path + ": found no line, expected one for each " +
                     kind);
  }
  const std::string lines =
      std::to_string(num_lines_) + (num_lines_ == 1 ? " line" : " lines");
  if (skipped_.count == num_lines_) {
    throw ModelError(file_.path + ": found no " + kind +
                     " of the model in its " + lines + ", the first has " +
                     Described(skipped_.first) +
                     "; expected those of the model" +
                     (line_of_.empty() ? std::string(", which has none")
                                       : ", such as " + Described(NameOf(0))));
  }
  if (!note) return;
  if (skipped_.count > 0) {
    note(file_.path + ": skipped " + std::to_string(skipped_.count) + " of " +
         lines + ", whose " + kind +
         " the model does not have; the first has " +
         Described(skipped_.first));
  }
  if (paths_.count > 0) {
    note(file_.path + ": paths are taken for the names that they end with, " +
         paths_.first + ", for one");
  }
}

}  // namespace krot::internal
