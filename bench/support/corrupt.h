#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <map>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "core/median.h"
#include "io/images/depth_encode.h"
#include "io/images/image_encode.h"
#include "io/sequence/convert.h"
#include "io/sequence/open_sequence.h"
#include "io/sequence/trajectory_file.h"

/// Copies of a sequence with one fault each, for the doctor to name.
namespace felt::corrupt {
namespace fs = std::filesystem;

/// A sequence in the generic layout, taken apart: what a fault changes. Images that no fault touches are linked.
struct Copy {
  PinholeCamera camera;
  double depth_scale = 0;
  std::vector<int64_t> number;
  std::vector<double> stamp_s;
  std::vector<Eigen::Isometry3d> pose;
  fs::path base;       ///< holds the sound images
  bool views = false;  ///< taken one by one by a camera at rest: between two of them nothing is known to move steadily
  // Images of one kind are written anew where their change is set.
  std::function<void(DepthImage&)> change_depth{};
  std::function<void(ColorImage&)> change_color{};
  std::function<void(LabelImage&)> change_labels{};
  std::function<uint16_t(uint16_t)> change_stored_depth{};
  std::vector<int64_t> without_depth{};
  std::vector<std::pair<int64_t, int64_t>> repeated{};  ///< image of the first replaces that of the second
};

struct Fault {
  std::string name;
  std::string topic;                 ///< that the doctor should call faulty
  std::function<bool(Copy&)> apply;  ///< false where it does not suit the sequence
};

inline std::string stem(int64_t number) {
  char name[32];
  std::snprintf(name, sizeof name, "%06lld", static_cast<long long>(number));
  return name;
}

/// Converts up to `most_frames` frames of a recording to the generic layout at `base`.
inline Copy sound_copy(const fs::path& recording, const fs::path& base, int64_t most_frames) {
  const auto reader = open_sequence(recording, {.frames = {.last = most_frames}});
  // Skipped frames must not look like lost ones.
  std::vector<int64_t> original_number;
  for (int64_t i = 0; i < reader->size(); ++i)
    if (const ReadResult read = reader->read(i); const auto* frame = std::get_if<Frame>(&read))
      original_number.push_back(frame->index);
  convert_sequence(*reader, base, {.renumber = true});
  const SequenceListing listing = list_sequence(base);
  Copy copy;
  copy.base = base;
  copy.camera = reader->info().camera;
  copy.depth_scale = listing.depth_scale;
  const auto original = list_sequence(recording);
  for (const FrameRecord& frame : listing.frames) {
    const int64_t recorded = original_number[size_t(frame.index)];
    copy.number.push_back(frame.index);
    Eigen::Isometry3d T;
    T.matrix() = *frame.pose;
    copy.pose.push_back(T);
    const auto same = std::find_if(original.frames.begin(), original.frames.end(),
                                   [&](const FrameRecord& other) { return other.index == recorded; });
    copy.stamp_s.push_back(original.stamped ? same->stamp_s : double(recorded) / 30);
  }
  return copy;
}

/// Writes the copy as a sequence at `out`.
inline void write(const Copy& copy, const fs::path& out, bool with_stamps = false) {
  fs::create_directories(out);
  std::ofstream yaml(out / "sequence.yaml");
  yaml.precision(17);
  yaml << "camera: {fx: " << copy.camera.fx << ", fy: " << copy.camera.fy << ", cx: " << copy.camera.cx
       << ", cy: " << copy.camera.cy << ", width: " << copy.camera.width << ", height: " << copy.camera.height
       << "}\ndepth_scale: " << copy.depth_scale << "\n";
  std::ofstream poses(out / "poses.txt");
  poses.precision(17);
  for (size_t i = 0; i < copy.pose.size(); ++i) {
    if (with_stamps)
      poses << copy.stamp_s[i] + 1000.0001;  // no stamp may look like a frame number
    else
      poses << copy.number[i];
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 4; ++column) poses << ' ' << copy.pose[i].matrix()(row, column);
    poses << '\n';
  }
  const bool depth_written = copy.change_depth || copy.change_stored_depth,
             depth_listed = !copy.without_depth.empty() || !copy.repeated.empty();
  const std::map<std::string, bool> written = {{"depth", depth_written || depth_listed},
                                               {"color", bool(copy.change_color)},
                                               {"labels", bool(copy.change_labels)},
                                               {"probs", false},
                                               {"instances", false},
                                               {"classes.yaml", false}};
  for (const auto& [name, anew] : written) {
    if (!fs::exists(copy.base / name)) continue;
    if (anew)
      fs::create_directories(out / name);
    else
      fs::create_symlink(copy.base / name, out / name);
  }
  if (depth_written || copy.change_color || copy.change_labels) {
    const auto reader = open_sequence(copy.base, {.read_color = bool(copy.change_color), .read_instances = false});
    tbb::parallel_for(int64_t(0), reader->size(), [&](int64_t i) {
      auto frame = std::get<Frame>(reader->read(i));
      const std::string name = stem(frame.index) + ".png";
      if (copy.change_color) {
        copy.change_color(frame.color);
        write_bytes(out / "color" / name, encode_png(frame.color));
      }
      if (copy.change_labels) {
        copy.change_labels(frame.labels);
        write_bytes(out / "labels" / name, encode_png(frame.labels));
      }
      if (!depth_written) return;
      if (copy.change_depth) copy.change_depth(frame.depth_m);
      int64_t lost = 0;
      Image<uint16_t> stored = stored_depth(frame.depth_m, copy.depth_scale, lost);
      if (copy.change_stored_depth)
        for (uint16_t& value : stored) value = copy.change_stored_depth(value);
      write_bytes(out / "depth" / name, encode_png(stored));
    });
  }
  if (!depth_listed) return;
  for (const int64_t number : copy.number) {
    if (std::count(copy.without_depth.begin(), copy.without_depth.end(), number) > 0) continue;
    int64_t source = number;
    for (const auto& [from, to] : copy.repeated)
      if (to == number) source = from;
    fs::create_symlink(copy.base / "depth" / (stem(source) + ".png"), out / "depth" / (stem(number) + ".png"));
  }
}

inline std::vector<Fault> faults() {
  const auto scale = [](double wrong) {
    return [wrong](Copy& c) {
      if (std::abs(c.depth_scale / wrong - 1) < 0.01) return false;
      c.depth_scale = wrong;
      return true;
    };
  };
  const auto focal = [](double factor) {
    return [factor](Copy& c) {
      c.camera.fx *= factor, c.camera.fy *= factor;
      return true;
    };
  };
  return {
      {"inverse poses", "pose-convention",
       [](Copy& c) {
         for (auto& T : c.pose) T = T.inverse();
         return true;
       }},
      {"OpenGL axes", "camera-axes",
       [](Copy& c) {
         for (auto& T : c.pose) T.linear() = T.linear() * Eigen::Vector3d(1, -1, -1).asDiagonal();
         return true;
       }},
      {"scale 1000", "depth-scale", scale(1000)},
      {"scale 5000", "depth-scale", scale(5000)},
      {"scale 6553.5", "depth-scale", scale(6553.5)},
      {"scale 10000", "depth-scale", scale(10000)},
      {"ray length", "depth-along",
       [](Copy& c) {
         const PinholeCamera camera = c.camera;
         c.change_depth = [camera](DepthImage& depth_m) {
           for (int v = 0; v < camera.height; ++v)
             for (int u = 0; u < camera.width; ++u) depth_m(u, v) *= float(camera.ray(u, v).norm());
         };
         return true;
       }},
      {"BGR", "color-order",
       [](Copy& c) {
         if (!fs::exists(c.base / "color")) return false;
         c.change_color = [](ColorImage& color) {
           for (Rgba8& pixel : color) std::swap(pixel.r, pixel.b);
         };
         return true;
       }},
      {"poses 50 ms late", "stamp-offset",
       [](Copy& c) {
         std::vector<StampedPose> poses;
         std::vector<double> steps;
         for (size_t i = 0; i < c.pose.size(); ++i) {
           poses.push_back({c.stamp_s[i], c.pose[i].matrix(), 0});
           if (i > 0) steps.push_back(c.stamp_s[i] - c.stamp_s[i - 1]);
         }
         if (poses.size() < 8) return false;
         // Views with minutes between them have no motion to interpolate.
         if (c.views) return false;
         if (*std::max_element(steps.begin(), steps.end()) > 5 * median(steps)) return false;
         Copy moved = c;
         moved.number.clear(), moved.stamp_s.clear(), moved.pose.clear();
         for (size_t i = 0; i < c.pose.size(); ++i) {
           Eigen::Isometry3d T = c.pose[i];
           if (c.stamp_s[i] + 0.05 <= c.stamp_s.back())
             T.matrix() = *pose_at_stamp(poses, c.stamp_s, c.stamp_s[i] + 0.05, 1e9);
           moved.number.push_back(c.number[i]), moved.stamp_s.push_back(c.stamp_s[i]), moved.pose.push_back(T);
         }
         c = moved;
         return true;
       }},
      {"shuffled poses", "trajectory",
       [](Copy& c) {
         std::mt19937 random(7);
         for (size_t i = c.pose.size() - 1; i > 0; --i) std::swap(c.pose[i], c.pose[random() % (i + 1)]);
         return c.pose.size() > 4;
       }},
      {"focal length x 0.8", "focal-length", focal(0.8)},
      {"focal length x 1.25", "focal-length", focal(1.25)},
      {"labels plus one", "labels",
       [](Copy& c) {
         if (!fs::exists(c.base / "labels") || !fs::exists(c.base / "classes.yaml")) return false;
         c.change_labels = [](LabelImage& labels) {
           for (uint16_t& id : labels) id = uint16_t(id + 1);
         };
         return true;
       }},
      {"width and height exchanged", "image-size",
       [](Copy& c) {
         std::swap(c.camera.width, c.camera.height);
         std::swap(c.camera.fx, c.camera.fy), std::swap(c.camera.cx, c.camera.cy);
         return true;
       }},
      {"cx and cy exchanged", "image-size",
       [](Copy& c) {
         std::swap(c.camera.cx, c.camera.cy);
         return true;
       }},
      {"repeated frames", "duplicates",
       [](Copy& c) {
         for (size_t i = 1; i < c.number.size(); i += 5) c.repeated.push_back({c.number[i - 1], c.number[i]});
         return true;
       }},
      {"lost depth images", "frames",
       [](Copy& c) {
         for (size_t i = 2; i < c.number.size(); i += 9) c.without_depth.push_back(c.number[i]);
         return !c.without_depth.empty();
       }},
      {"trajectory jumps by 0.5 m", "trajectory",
       [](Copy& c) {
         for (size_t i = c.pose.size() / 2; i < c.pose.size(); ++i)
           c.pose[i].translation() += Eigen::Vector3d(0.3, -0.4, 0);
         return c.pose.size() > 4;
       }},
      {"rotated depth bits", "depth-encoding",
       [](Copy& c) {
         c.depth_scale = 10000;  // as such recordings are
         c.change_stored_depth = [](uint16_t v) { return uint16_t(v << 3 | v >> 13); };
         return true;
       }},
  };
}

}  // namespace felt::corrupt
