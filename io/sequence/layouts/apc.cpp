#include "core/error.h"
#include "io/files/text_input.h"
#include "io/sequence/camera_file.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/trajectory_file.h"

// Recordings of the Amazon Picking Challenge (Zeng et al., ICRA 2017): camera and all poses in cam.info.txt, depth
// rotated by three bits in units of 0.1 mm, a probability map per object.
namespace felt {
namespace fs = std::filesystem;
namespace {

bool recognises(const fs::path& path) {
  return fs::exists(path / "cam.info.txt") && has_numbered_file(path, "frame-", {".depth.png"});
}

struct CameraInfo {
  Intrinsics color;
  std::map<int64_t, Eigen::Matrix4d> poses;
  std::vector<std::string> objects;
};

/// Names between double quotes.
std::vector<std::string> quoted_names(std::string_view line) {
  std::vector<std::string> names;
  for (size_t from = line.find('"'); from != std::string_view::npos; from = line.find('"', from)) {
    const size_t to = line.find('"', from + 1);
    if (to == std::string_view::npos) break;
    names.emplace_back(line.substr(from + 1, to - from - 1));
    from = to + 1;
  }
  return names;
}

CameraInfo read_camera_info(const fs::path& file) {
  const std::string content = read_whole_file(file, 1 << 26);
  CameraInfo info;
  LineReader lines(content, file);
  std::string title;
  std::vector<double> numbers;
  while (lines.next(false)) {
    if (lines.line().starts_with('#')) {
      title = lines.line();
      numbers.clear();
      if (title.starts_with("# Objects:")) info.objects = quoted_names(title);
      continue;
    }
    const std::vector<double> row = parse_numbers(lines.line(), lines.where());
    numbers.insert(numbers.end(), row.begin(), row.end());
    if (title.starts_with("# Color camera intrinsic") && numbers.size() == 9)
      info.color = intrinsics_of_numbers(numbers, lines.where());
    if (title.starts_with("# Camera-to-world") && numbers.size() == 16) {
      const auto number = trailing_number(title);
      if (!number)
        throw FormatError(describe_mismatch(lines.where(), "pose", "a title that ends in its frame number", title));
      info.poses[*number] = matrix_of_numbers(numbers.data(), 16);
    }
  }
  if (info.color.fx == 0)
    throw FormatError(
        describe_mismatch(file.string(), "camera", "'# Color camera intrinsic matrix' with 3 rows", "none"));
  return info;
}

SequenceListing list(const fs::path& path, const SequenceOptions& options) {
  SequenceListing listing;
  const CameraInfo info = read_camera_info(path / "cam.info.txt");
  if (!options.intrinsics) listing.intrinsics = info.color;  // depth is registered to colour
  listing.depth_encoding = DepthEncoding::rotated3;
  listing.depth_scale = 10000;
  listing.voxel_size_m = 0.005;  // shelves half a metre away
  const auto depth = numbered_files(path, "frame-", {".depth.png"}),
             color = numbered_files(path, "frame-", {".color.png"});
  for (const auto& [number, file] : depth) {
    FrameRecord frame;
    frame.index = number;
    frame.stamp_s = double(number);
    frame.depth.path = file;
    frame.color.path = at_number(color, number);
    if (const auto pose = info.poses.find(number); pose != info.poses.end()) frame.pose = pose->second;
    listing.frames.push_back(std::move(frame));
  }
  if (info.objects.empty()) return listing;
  std::vector<ClassInfo> classes = {{0, "background", default_class_color(0), false}};
  for (const std::string& object : info.objects) {
    const auto id = uint16_t(classes.size());
    classes.push_back({id, object, default_class_color(id), false});
    const auto maps = numbered_files(path / "masks", "frame-", {"." + object + ".mask.png"});
    for (FrameRecord& frame : listing.frames)
      if (const fs::path map = at_number(maps, frame.index); !map.empty())
        frame.class_maps.push_back({id, {.path = map}, 1});
  }
  listing.classes = ClassTable(std::move(classes));
  return listing;
}

}  // namespace

const Layout kApcLayout = {"apc", "cam.info.txt and frame-NNNNNN.depth.png", recognises, list};

}  // namespace felt
