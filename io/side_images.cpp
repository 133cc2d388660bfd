#include "io/side_images.h"

#include <map>

#include "core/error.h"
#include "io/layouts/file_names.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

/// Images of a folder by name without extension and, where no two share one, by the number in their names.
struct NamedImages {
  std::map<std::string, fs::path> by_stem;
  std::map<int64_t, fs::path> by_number;
};

NamedImages images_in(const fs::path& folder) {
  std::error_code fault;
  fs::directory_iterator files(folder, fault);
  if (fault) throw IoError(describe_mismatch(folder.string(), "folder", "a readable folder", fault.message()));
  NamedImages images;
  std::map<int64_t, int> uses;
  for (const fs::directory_entry& entry : files) {
    if (entry.path().extension() != ".png") continue;
    const std::string stem = entry.path().stem().string();
    images.by_stem[stem] = entry.path();
    if (const auto number = trailing_number(stem.substr(0, stem.find('.')))) {
      images.by_number[*number] = entry.path();
      ++uses[*number];
    }
  }
  for (const auto& [number, count] : uses)
    if (count > 1) images.by_number.erase(number);
  return images;
}

}  // namespace

void attach_images(const fs::path& folder, SequenceListing& listing, ImageSource FrameRecord::*member,
                   const char* what) {
  const NamedImages images = images_in(folder);
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

}  // namespace felt
