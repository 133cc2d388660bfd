#include "io/sequence/convert.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

#include "core/error.h"
#include "core/text.h"
#include "io/files/folder_in_progress.h"
#include "io/files/text_input.h"
#include "io/images/depth_encode.h"
#include "io/images/image_encode.h"
#include "io/images/label_images.h"
#include "io/sequence/camera_file.h"
#include "io/sequence/skip_reasons.h"
#include "io/tables/class_table_file.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

/// Where a layout keeps each kind of file, as printf patterns of the frame number; empty: it has no place for it.
struct FileNames {
  const char* layout;
  double depth_scale;       ///< 0: the sequence's own
  bool states_depth_scale;  ///< its files can say another one
  bool counts_from_zero;
  const char *depth, *color, *labels, *probabilities, *instances, *pose;
};

/// From here on the numbers of `generic`'s poses are stamps (layouts/generic.cpp).
constexpr double kLeastMoment = 1e9;

constexpr FileNames kLayouts[] = {
    {"generic", 0, true, false, "depth/%06lld.png", "color/%06lld", "labels/%06lld.png", "probs/%06lld.png",
     "instances/%06lld.png", ""},
    {"7scenes", 1000, false, false, "seq-01/frame-%06lld.depth.png", "seq-01/frame-%06lld.color",
     "seq-01/frame-%06lld.label.png", "", "", "seq-01/frame-%06lld.pose.txt"},
    {"tum", 5000, true, false, "depth/%06lld.png", "rgb/%06lld", "", "", "", ""},
    {"replica", 6553.5, true, true, "results/depth%06lld.png", "results/frame%06lld", "semantic/semantic%06lld.png", "",
     "instance/instance%06lld.png", ""},
    {"redwood", 1000, true, true, "depth/%05lld.png", "color/%05lld", "", "", "", ""},
    {"icl", 1000, false, false, "depth/%05lld.png", "color/%05lld", "labels/%05lld.png", "", "", "pose/%05lld.txt"},
};

std::string named(const char* pattern, int64_t number) {
  char name[96];
  std::snprintf(name, sizeof name, pattern, static_cast<long long>(number));
  return name;
}

std::string number(double value) { return number_text(value, "%.17g"); }
/// For people: three digits.
std::string short_number(double value) { return number_text(value, "%.3g"); }

/// The 16 numbers by rows, `between` after each row but the last.
std::string matrix_text(const Eigen::Isometry3d& T, const char* between) {
  std::string text;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      text += (row + column == 0 ? "" : column == 0 ? between : " ") + number(T.matrix()(row, column));
  return text;
}

std::string translation_quaternion_text(const Eigen::Isometry3d& T) {
  const Eigen::Quaterniond q(T.linear());
  std::string text;
  for (const double value : {T.translation().x(), T.translation().y(), T.translation().z(), q.x(), q.y(), q.z(), q.w()})
    text += (text.empty() ? "" : " ") + number(value);
  return text;
}

/// The sequence's own scale, or millimetres where it counts so coarsely that its depth was no whole numbers; coarser
/// where the sensor sees farther than 16 bits of them.
double own_scale(const SequenceInfo& info) {
  if (info.depth_scale >= 100) return info.depth_scale;
  double scale = 1000;
  while (info.max_depth_m * scale > 65534) scale /= 2;
  return scale;
}

/// Writes one sequence, frame by frame; the text files come at the end.
class Writer {
public:
  Writer(const FileNames& names, fs::path folder, const SequenceInfo& info, const ConvertOptions& options)
      : names_(names),
        folder_(std::move(folder)),
        info_(info),
        from_zero_(names.counts_from_zero || options.renumber),
        jpeg_(options.jpeg_color) {
    depth_scale_ = options.depth_scale > 0 ? options.depth_scale
                   : names.depth_scale > 0 ? names.depth_scale
                                           : own_scale(info);
  }

  /// What the layout cannot say about the depth of any frame.
  void add_depth_losses(const ConvertOptions& options, ConvertResult& result) const {
    const bool generic = names_.layout == std::string("generic");
    if (info_.voxel_size_m > 0 && !generic) result.left_out.emplace_back("the voxel size that suits the sensor");
    if (info_.max_depth_m > 0 && !generic) result.left_out.emplace_back("the depth that the sensor reaches to");
    // A scale that was asked for is no surprise.
    if (options.depth_scale == 0 && (info_.depth_scale > depth_scale_ || info_.depth_scale < 100))
      result.left_out.push_back("depth steps finer than " + short_number(1000 / depth_scale_) + " mm");
  }

  void add(const Frame& frame, ConvertResult& result) {
    const auto lost = [&](bool there, const char* pattern, const char* what) {
      if (there && *pattern == 0 &&
          std::find(result.left_out.begin(), result.left_out.end(), what) == result.left_out.end())
        result.left_out.emplace_back(what);
    };
    lost(!frame.labels.empty(), names_.labels, "labels");
    lost(!frame.probabilities.empty(), names_.probabilities, "probabilities");
    lost(!frame.instances.empty(), names_.instances, "instances");
    lost(jpeg_ && std::any_of(frame.color.begin(), frame.color.end(), [](Rgba8 c) { return c.a == 0; }), "",
         "which pixels have no colour");
    lost(frame.stamp_s != double(frame.index), keeps_stamps() ? "stamps" : "", "stamps");
    const int64_t i = from_zero_ ? result.written : frame.index;
    result.depth_measured +=
        std::count_if(frame.depth_m.begin(), frame.depth_m.end(), [](float depth_m) { return depth_m > 0; });
    put(named(names_.depth, i), encode_png(stored_depth(frame.depth_m, depth_scale_, result.depth_out_of_range)));
    const std::string color = named(names_.color, i) + (jpeg_ ? ".jpg" : ".png");
    if (!frame.color.empty()) put(color, jpeg_ ? encode_jpeg(frame.color) : encode_png(frame.color));
    if (!frame.labels.empty() && *names_.labels != 0) put(named(names_.labels, i), encode_png(frame.labels));
    if (!frame.instances.empty() && *names_.instances != 0)
      put(named(names_.instances, i), encode_png(frame.instances));
    if (!frame.probabilities.empty() && *names_.probabilities != 0)
      put(named(names_.probabilities, i), encode_probabilities(frame.probabilities));
    if (*names_.pose != 0) put(named(names_.pose, i), matrix_text(frame.T_world_camera, "\n") + "\n");
    if (names_.layout == std::string("tum")) {
      const std::string stamp = number_with_microseconds(frame.stamp_s);
      depth_list_ += stamp + " " + named(names_.depth, i) + "\n";
      if (!frame.color.empty()) color_list_ += stamp + " " + color + "\n";
      poses_ += stamp + " " + translation_quaternion_text(frame.T_world_camera) + "\n";
    } else if (names_.layout == std::string("redwood")) {
      poses_ += std::to_string(i) + " " + std::to_string(i) + " " + std::to_string(i + 1) + "\n" +
                matrix_text(frame.T_world_camera, "\n") + "\n";
    } else if (names_.layout == std::string("replica")) {
      poses_ += matrix_text(frame.T_world_camera, " ") + "\n";
    } else if (names_.layout == std::string("generic")) {
      numbered_.push_back({i, frame.stamp_s, matrix_text(frame.T_world_camera, " ")});
    }
    ++result.written;
  }

  void finish(ConvertResult& result) {
    const PinholeCamera& c = info_.camera;
    const std::string fx = number(c.fx), fy = number(c.fy), cx = number(c.cx), cy = number(c.cy),
                      width = std::to_string(c.width), height = std::to_string(c.height), scale = number(depth_scale_);
    const std::string rows = fx + " 0 " + cx + "\n0 " + fy + " " + cy + "\n0 0 1\n";
    const std::string camera =
        "fx: " + fx + ", fy: " + fy + ", cx: " + cx + ", cy: " + cy + ", width: " + width + ", height: " + height;
    const std::string layout = names_.layout;
    const bool other_scale = depth_scale_ != names_.depth_scale;
    if (layout == "generic") {
      put("sequence.yaml", "camera: {" + camera + "}\ndepth_scale: " + scale + "\npose_convention: camera-to-world\n" +
                               (info_.voxel_size_m > 0 ? "voxel_size: " + number(info_.voxel_size_m) + "\n" : "") +
                               (info_.max_depth_m > 0 ? "max_depth: " + number(info_.max_depth_m) + "\n" : ""));
      put("poses.txt", numbered_text());
      if (!has_moments() && std::any_of(numbered_.begin(), numbered_.end(),
                                        [](const NumberedPose& p) { return p.stamp_s != double(p.number); }))
        result.left_out.emplace_back("stamps");
    } else if (layout == "tum") {
      put("depth.txt", "# timestamp filename\n" + depth_list_);
      put("rgb.txt", "# timestamp filename\n" + color_list_);
      put("groundtruth.txt", "# timestamp tx ty tz qx qy qz qw\n" + poses_);
      if (other_scale)
        put("camera.yaml", "{" + camera + ", depth_scale: " + scale + "}\n");
      else
        put("camera-intrinsics.txt", rows);
    } else if (layout == "replica") {
      put("traj.txt", poses_);
      put("cam_params.json", "{\"camera\": {\"w\": " + width + ", \"h\": " + height + ", \"fx\": " + fx + ", \"fy\": " +
                                 fy + ", \"cx\": " + cx + ", \"cy\": " + cy + ", \"scale\": " + scale + "}}\n");
    } else if (layout == "redwood") {
      put("trajectory.log", poses_);
      put("intrinsic.json", "{\"width\": " + width + ", \"height\": " + height + ", \"intrinsic_matrix\": [" + fx +
                                ", 0, 0, 0, " + fy + ", 0, " + cx + ", " + cy + ", 1]" +
                                (other_scale ? ", \"depth_scale\": " + scale : "") + "}\n");
    } else {
      put(layout == "7scenes" ? "camera-intrinsics.txt" : "intrinsics.txt",
          (layout == "7scenes" ? std::string(kRegisteredMark) + "\n" : "") + rows);
    }
    if (!info_.classes.empty()) put("classes.yaml", class_table_yaml(info_.classes));
  }

  /// The property table and the touches that the sequence carries, as they are; only `generic` has a place for them,
  /// and touches name frames by their numbers.
  void add_tables(ConvertResult& result) {
    const bool generic = names_.layout == std::string("generic");
    const auto copy = [&](const fs::path& file, const char* name, bool keeps) {
      if (file.empty()) return;
      if (keeps)
        put(name, read_whole_file(file));
      else
        result.left_out.push_back(file.filename().string());
    };
    copy(info_.properties_file, "properties.yaml", generic);
    if (!generic || from_zero_ || info_.touches_file.empty()) return copy(info_.touches_file, "touches.csv", false);
    int64_t elsewhere = 0;
    put("touches.csv", touches_text(info_.touches_file, elsewhere));
    result.touches_elsewhere = elsewhere;
  }

  /// Stored units per metre.
  double depth_scale() const { return depth_scale_; }

private:
  bool keeps_stamps() const { return names_.layout == std::string("generic") || names_.layout == std::string("tum"); }

  template <typename Bytes>
  void put(const std::string& name, const Bytes& bytes) {
    const fs::path path = folder_ / name;
    std::error_code fault;
    fs::create_directories(path.parent_path(), fault);
    if (fault) throw IoError(path.parent_path().string() + ": cannot be made: " + fault.message());
    write_bytes(path, {bytes.begin(), bytes.end()});
  }

  /// Whether stamps are told from frame numbers when they are read again: by a fraction, or by their size.
  bool has_moments() const {
    return std::any_of(numbered_.begin(), numbered_.end(), [](const NumberedPose& p) {
      return p.stamp_s != std::floor(p.stamp_s) || p.stamp_s >= kLeastMoment;
    });
  }

  /// The rows of touches whose frame is written, and the header; counts the others.
  std::string touches_text(const fs::path& file, int64_t& elsewhere) const {
    const bool moments = has_moments();
    double first = std::numeric_limits<double>::infinity(), last = -first;
    std::set<int64_t> numbers;
    for (const NumberedPose& p : numbered_) {
      numbers.insert(p.number);
      const double stamp_s = moments ? p.stamp_s : double(p.number);
      first = std::min(first, stamp_s), last = std::max(last, stamp_s);
    }
    const auto is_written = [&](const std::string& cell, bool is_number) {
      constexpr double kRoundingS = 1e-6;  // stamps are written with as many digits
      if (is_number) {
        const auto frame = parse_integer(cell);
        return frame && numbers.contains(*frame);
      }
      const auto stamp_s = parse_number(cell);
      return stamp_s && *stamp_s >= first - kRoundingS && *stamp_s <= last + kRoundingS;
    };
    const std::string content = read_whole_file(file);
    std::string text;
    std::vector<std::string> header;
    char separator = ',';
    for (LineReader lines(content, file.string()); lines.next();) {
      if (header.empty()) separator = csv_separator(lines.line());
      const std::vector<std::string> cells = csv_cells(lines.line(), separator);
      bool written = true;
      if (header.empty())
        header = cells;
      else
        for (size_t i = 0; i < std::min(cells.size(), header.size()); ++i)
          if ((header[i] == "frame" || header[i] == "stamp") && !cells[i].empty())
            written &= is_written(cells[i], header[i] == "frame");
      if (written)
        text += std::string(lines.line()) + "\n";
      else
        ++elsewhere;
    }
    return text;
  }

  /// A pose a line, by the moment if there are moments: whole numbers would be taken for frame numbers.
  std::string numbered_text() const {
    const bool moments = has_moments();
    std::string text;
    for (const NumberedPose& p : numbered_)
      text += (moments ? number(p.stamp_s) : std::to_string(p.number)) + " " + p.matrix + "\n";
    return text;
  }

  static std::string number_with_microseconds(double value) { return number_text(value, "%.6f"); }

  const FileNames& names_;
  fs::path folder_;
  const SequenceInfo& info_;
  bool from_zero_, jpeg_;
  double depth_scale_ = 0;
  std::string poses_, depth_list_, color_list_;
  struct NumberedPose {
    int64_t number;
    double stamp_s;
    std::string matrix;
  };
  std::vector<NumberedPose> numbered_;
};

const FileNames& names_of(const std::string& layout) {
  for (const FileNames& names : kLayouts)
    if (names.layout == layout) return names;
  throw ConfigError(
      describe_mismatch("--to", "layout", "one of " + listed(kLayouts, &FileNames::layout), "'" + layout + "'"));
}

}  // namespace

std::vector<std::string> writable_layouts() {
  std::vector<std::string> layouts;
  for (const FileNames& names : kLayouts) layouts.emplace_back(names.layout);
  return layouts;
}

ConvertResult convert_sequence(const SequenceReader& reader, const fs::path& out, const ConvertOptions& options,
                               const std::function<bool(int64_t)>& progress) {
  const FileNames& names = names_of(options.layout);
  if (!(options.depth_scale >= 0 && options.depth_scale <= kMostDepthScale))
    throw ConfigError(describe_mismatch("--written-depth-scale", "units per metre", "at most 1000000, or 0",
                                        std::to_string(options.depth_scale)));
  if (options.depth_scale > 0 && options.depth_scale != names.depth_scale && !names.states_depth_scale)
    throw ConfigError(
        describe_mismatch("--written-depth-scale", "units per metre",
                          number(names.depth_scale) + ", as no file of " + options.layout + " can state another",
                          number(options.depth_scale)));
  std::error_code fault;
  if (fs::exists(out, fault) && !(fs::is_directory(out) && fs::is_empty(out)))
    throw IoError(describe_mismatch(out.string(), "output", "a folder that does not exist yet", "something there"));
  if (const fs::path parent = (out / "").parent_path().parent_path(); !parent.empty()) {
    fs::create_directories(parent, fault);
    if (fault) throw IoError(parent.string() + ": cannot be made: " + fault.message());
  }
  FolderInProgress folder(out);
  ConvertResult result;
  Writer writer(names, folder.path(), reader.info(), options);
  writer.add_depth_losses(options, result);
  for (int64_t i = 0; i < reader.size(); ++i) {
    const ReadResult read = reader.read(i);
    if (const auto* skipped = std::get_if<SkippedFrame>(&read))
      ++result.skipped[skipped->reason];
    else
      writer.add(std::get<Frame>(read), result);
    if (progress && !progress(i + 1)) return {};
  }
  if (result.written == 0) {
    const std::string reasons = skipped_text(result.skipped);
    throw FormatError(describe_mismatch(reader.info().path.string(), "frames", "at least one that can be read",
                                        reasons.empty() ? "none" : "none: " + reasons));
  }
  if (2 * result.depth_out_of_range > result.depth_measured)
    throw FormatError(describe_mismatch(
        reader.info().path.string(), "depth written at " + number(writer.depth_scale()) + " units per metre",
        "most of it from 1 to 65534 units, up to " + short_number(65534 / writer.depth_scale()) + " m",
        std::to_string(result.depth_out_of_range) + " of " + std::to_string(result.depth_measured) +
            " measured pixels outside; --written-depth-scale says another scale, in a layout that can state it"));
  writer.finish(result);
  writer.add_tables(result);
  folder.commit();
  return result;
}

}  // namespace felt
