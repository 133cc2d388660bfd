#include "io/sequence/probability_images.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "io/files/text_input.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/side_images.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

std::map<int64_t, FrameRecord*> frames_by_number(SequenceListing& listing) {
  std::map<int64_t, FrameRecord*> frames;
  for (FrameRecord& frame : listing.frames) frames[frame.index] = &frame;
  return frames;
}

/// In a fixed order: sums of probabilities depend on it.
std::vector<fs::path> sorted_entries_of(const fs::path& folder) {
  std::vector<fs::path> entries = entries_of(folder);
  std::sort(entries.begin(), entries.end());
  return entries;
}

/// "3_17_0.87": class 17 with score 0.87.
std::optional<ClassMap> detection_of(const fs::path& file) {
  if (file.extension() != ".png") return std::nullopt;
  const std::string stem = file.stem().string();
  const std::vector<std::string_view> words = split_words(stem, '_');
  if (words.size() < 2) return std::nullopt;
  const auto id = parse_integer(words[words.size() - 2]);
  const auto score = parse_number(words.back());
  if (!id || *id < 0 || *id > 0xffff || !score || !(*score >= 0 && *score <= 1)) return std::nullopt;
  return ClassMap{uint16_t(*id), {.path = file}, float(*score), true};
}

bool attach_detections(const std::vector<fs::path>& entries, SequenceListing& listing) {
  const auto frames = frames_by_number(listing);
  bool any = false;
  for (const fs::path& entry : entries) {
    if (!fs::is_directory(entry)) continue;
    const auto number = trailing_number(entry.filename().string());
    const auto frame = number ? frames.find(*number) : frames.end();
    if (frame == frames.end()) continue;
    for (const fs::path& file : sorted_entries_of(entry))
      if (const auto detection = detection_of(file)) frame->second->class_maps.push_back(*detection), any = true;
  }
  return any;
}

/// "frame-000012.CLASS.mask.png" or "frame-000012.CLASS.png".
bool attach_class_maps(const std::vector<fs::path>& entries, SequenceListing& listing) {
  const auto frames = frames_by_number(listing);
  std::map<std::string, uint16_t> ids;
  for (const ClassInfo& c : listing.classes.classes()) ids[c.name] = c.id;
  bool any = false;
  for (const fs::path& entry : entries) {
    const std::string name = entry.filename().string();
    const std::vector<std::string_view> words = split_words(name, '.');
    if (words.size() < 3 || words.back() != "png" || (words.size() == 4 && words[2] != "mask") || words.size() > 4)
      continue;
    const auto number = trailing_number(words[0]);
    const auto frame = number ? frames.find(*number) : frames.end();
    const auto id = ids.find(std::string(words[1]));
    if (frame == frames.end() || id == ids.end()) continue;
    frame->second->class_maps.push_back({id->second, {.path = entry}, 1, false});
    any = true;
  }
  return any;
}

}  // namespace

void attach_probabilities(const fs::path& folder, SequenceListing& listing) {
  const std::vector<fs::path> entries = sorted_entries_of(folder);
  for (FrameRecord& frame : listing.frames) {
    frame.probabilities.path.clear();
    frame.class_maps.clear();
  }
  if (attach_detections(entries, listing) || attach_class_maps(entries, listing)) return;
  attach_images(folder, listing, &FrameRecord::probabilities, "probabilities");
}

ProbabilityImage probabilities_of_stack(const Image<uint16_t>& stack, int height, float full_scale) {
  const int width = stack.width(), top = stack.height() / (2 * height);
  ProbabilityImage image{width, height, top, {}, {}};
  const size_t pixels = size_t(width) * size_t(height), m_planes = size_t(top);
  image.class_id.resize(pixels * m_planes);
  image.probability.resize(pixels * m_planes);
  for (size_t m = 0; m < m_planes; ++m)
    for (size_t p = 0; p < pixels; ++p) {
      image.class_id[p * m_planes + m] = stack.data()[m * pixels + p];
      image.probability[p * m_planes + m] = float(stack.data()[(m_planes + m) * pixels + p]) / full_scale;
    }
  return image;
}

ProbabilityImage probabilities_of_confidence(const LabelImage& labels, const Image<uint16_t>& confidence,
                                             float full_scale) {
  ProbabilityImage image{labels.width(), labels.height(), 1, {labels.begin(), labels.end()}, {}};
  image.probability.reserve(confidence.size());
  for (const uint16_t value : confidence) image.probability.push_back(std::min(1.0f, float(value) / full_scale));
  return image;
}

ProbabilityImage joined_class_maps(std::span<const DecodedClassMap> maps, bool rest_is_class_0, int most) {
  if (maps.empty()) return {};
  const int width = maps[0].values.width(), height = maps[0].values.height();
  const size_t pixels = maps[0].values.size();
  std::map<uint16_t, std::vector<const DecodedClassMap*>> by_class;
  for (const DecodedClassMap& map : maps) by_class[map.class_id].push_back(&map);
  const size_t classes = by_class.size(), kept = std::min(classes, size_t(most)), top = kept + 1;
  ProbabilityImage image{width, height, int(top), std::vector<uint16_t>(pixels * top),
                         std::vector<float>(pixels * top)};
  std::vector<uint16_t> ids;
  for (const auto& [id, of_class] : by_class) ids.push_back(id);
  std::vector<float> p(classes);
  std::vector<size_t> order(classes);
  for (size_t pixel = 0; pixel < pixels; ++pixel) {
    size_t c = 0;
    float sum = 0;
    for (const auto& [id, of_class] : by_class) {
      p[c] = 0;
      for (const DecodedClassMap* map : of_class)
        p[c] = std::max(p[c], std::min(1.0f, float(map->values.data()[pixel]) * map->scale));
      sum += p[c++];
    }
    std::iota(order.begin(), order.end(), size_t(0));
    if (kept < classes)
      std::partial_sort(order.begin(), order.begin() + std::ptrdiff_t(kept), order.end(),
                        [&](size_t a, size_t b) { return p[a] > p[b] || (p[a] == p[b] && a < b); });
    uint16_t* const id = &image.class_id[pixel * top];
    float* const probability = &image.probability[pixel * top];
    const float scale = sum > 1 ? 1 / sum : 1;
    probability[0] = rest_is_class_0 ? std::max(0.0f, 1 - sum) : 0;
    for (size_t m = 0; m < kept; ++m) {
      id[m + 1] = ids[order[m]];
      probability[m + 1] = p[order[m]] * scale;
    }
  }
  return image;
}

}  // namespace felt
