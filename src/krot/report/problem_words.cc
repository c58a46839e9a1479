#include "krot/report/problem_words.h"

#include <algorithm>
#include <cmath>

namespace krot {
namespace {

constexpr size_t kNumNamed = 5;

// The first few, with commas.
template <typename Item, typename Name>
std::string FirstFew(const std::vector<Item>& items, const Name& name) {
  std::string list;
  for (size_t n = 0; n < std::min(items.size(), kNumNamed); ++n) {
    list += (n == 0 ? "" : ", ") + name(items[n]);
  }
  return list + (items.size() > kNumNamed ? ", ..." : "");
}

// "1 image is", "2 images are".
std::string CountedAre(size_t count, const std::string& noun) {
  return Counted(static_cast<int64_t>(count), noun) +
         (count == 1 ? " is" : " are");
}

std::string NameOf(const LooseImage& image) {
  const std::string moved =
      std::isfinite(image.moved)
          ? ", moved by " + FormatLength(image.moved) + " units"
          : "";
  return image.image_name + " (" +
         Counted(image.num_observations, "observation") + moved + ")";
}

std::string LooseImagesSentence(const std::vector<LooseImage>& images) {
  if (images.empty()) return "";
  const std::string their = images.size() == 1 ? "its" : "their";
  return CountedAre(images.size(), "image") + " not held in place: " + their +
         " observations fit as well from farther away. Check " + their +
         " matches. Moved no farther than needed: " +
         FirstFew(images, &NameOf) + ".\n";
}

std::string RunawaysSentence(const std::vector<LooseImage>& images) {
  if (images.empty()) return "";
  return Counted(static_cast<int64_t>(images.size()), "image") +
         " moved farther than cameras are from what they see: " +
         FirstFew(images, &NameOf) + ".\n";
}

std::string LoosePointsSentence(const std::vector<LoosePoint>& points) {
  if (points.empty()) return "";
  double farthest = 0;
  for (const LoosePoint& point : points) {
    farthest = std::max(farthest, point.moved);
  }
  return CountedAre(points.size(), "point") +
         " not determined: the rays are parallel up to noise, and any distance "
         "fits. Moved by at most " +
         FormatLength(farthest) + " units: point3D_id " +
         FirstFew(points,
                  [](const LoosePoint& point) {
                    return std::to_string(point.point3D_id);
                  }) +
         ".\n";
}

}  // namespace

std::string LeftOutWords(const LeftOutCounts& left_out) {
  int64_t total = 0;
  std::string list;
  for (const auto& [reason, count] : left_out) {
    total += count;
    if (count == 0) continue;
    list += (list.empty() ? "" : ", ") + reason + " " + std::to_string(count);
  }
  return Counted(total, "observation") + " left out" +
         (list.empty() ? "" : " (" + list + ")");
}

std::string NothingToDoSentence(const std::string& what,
                                const LeftOutCounts& left_out) {
  bool has_observations = false;
  for (const auto& [reason, count] : left_out) has_observations |= count > 0;
  return "nothing to " + what + ": " +
         (has_observations ? LeftOutWords(left_out) : kNoObservations);
}

std::string LooseSentences(const LooseParts& loose, int64_t num_images) {
  std::vector<LooseImage> undetermined;
  std::vector<LooseImage> runaways;
  for (const LooseImage& image : loose.images) {
    (image.is_determined ? runaways : undetermined).push_back(image);
  }
  const auto num_loose = static_cast<int64_t>(loose.images.size());
  return LooseImagesSentence(undetermined) + RunawaysSentence(runaways) +
         (num_loose > 0 && num_loose < num_images
              ? "The place and the size of the model are those of the other " +
                    Counted(num_images - num_loose, "image") + ".\n"
              : "") +
         LoosePointsSentence(loose.points);
}

}  // namespace krot
