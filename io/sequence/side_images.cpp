#include "io/sequence/side_images.h"

#include <algorithm>
#include <map>

#include "core/error.h"
#include "io/files/text_input.h"
#include "io/sequence/layouts/file_names.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

/// Images of a folder by name without extension and, where no two share one, by the number in their names.
struct NamedImages {
  std::map<std::string, fs::path> by_stem;
  std::map<int64_t, fs::path> by_number;
};

NamedImages images_in(const fs::path& folder, bool folders) {
  NamedImages images;
  std::map<int64_t, int> uses;
  for (const fs::path& entry : entries_of(folder)) {
    if (entry.extension() != ".png" && !(folders && fs::is_directory(entry))) continue;
    const std::string stem = entry.stem().string();
    images.by_stem[stem] = entry;
    if (const auto number = trailing_number(stem.substr(0, stem.find('.')))) {
      images.by_number[*number] = entry;
      ++uses[*number];
    }
  }
  for (const auto& [number, count] : uses)
    if (count > 1) images.by_number.erase(number);
  return images;
}

/// PNG images of a folder by name, numbers within names in their order.
std::vector<ImageSource> masks_in(const fs::path& folder) {
  std::vector<ImageSource> masks;
  for (const fs::path& entry : entries_of(folder))
    if (entry.extension() == ".png") masks.push_back({.path = entry});
  const auto key = [](const ImageSource& mask) {
    const std::string stem = mask.path.stem().string();
    return std::pair(parse_integer(stem).value_or(-1), stem);
  };
  std::sort(masks.begin(), masks.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
  return masks;
}

}  // namespace

void attach_images(const fs::path& folder, SequenceListing& listing, ImageSource FrameRecord::*member, const char* what,
                   bool folders) {
  const NamedImages images = images_in(folder, folders);
  bool any = false;
  for (FrameRecord& frame : listing.frames) {
    fs::path& path = (frame.*member).path;
    path.clear();
    for (const ImageSource* partner : {&frame.depth, &frame.color})
      if (const auto found = images.by_stem.find(partner->path.stem().string());
          path.empty() && found != images.by_stem.end())
        path = found->second;
    if (const auto found = images.by_number.find(frame.index); path.empty() && found != images.by_number.end())
      path = found->second;
    any |= !path.empty();
  }
  if (!any)
    throw FormatError(
        describe_mismatch(folder.string(), what, "PNG images named by frame number or like the depth images",
                          std::to_string(images.by_stem.size()) + " PNG images, none of them of a frame"));
}

void attach_labels(const fs::path& folder, SequenceListing& listing) {
  attach_images(folder, listing, &FrameRecord::labels, "labels");
}

void attach_instances(const fs::path& folder, SequenceListing& listing) {
  attach_images(folder, listing, &FrameRecord::instances, "instances", /*folders=*/true);
  for (FrameRecord& frame : listing.frames) {
    frame.masks.clear();
    if (frame.instances.empty() || !fs::is_directory(frame.instances.path)) continue;
    frame.masks = masks_in(frame.instances.path);
    frame.instances = {};
  }
}

}  // namespace felt
