#include "apps/options/reading_options.h"

#include <cmath>

#include "apps/command.h"
#include "core/text.h"
#include "io/sequence/open_sequence.h"
#include "io/sequence/pose_list.h"

namespace felt::apps {

bool names_sequence(const std::filesystem::path& path) {
  return std::filesystem::is_directory(path) || path.extension() == ".sens" || path.extension() == ".bin";
}

void add_reading_options(CLI::App& command, ReadingArguments& a) {
  command.add_option("--format", a.format, "Layout: 7scenes, tum, replica, generic, ...")->group(kReadingGroup);
  command.add_option("--frames", a.frames, "Frames a:b:step in recorded order, counted from 0")->group(kReadingGroup);
  command.add_option("--intrinsics", a.intrinsics, "fx,fy,cx,cy of the depth image, pixels")->group(kReadingGroup);
  command.add_option("--distortion", a.distortion, "k1,k2,p1,p2[,k3] of the depth image's lens (radial-tangential)")
      ->group(kReadingGroup);
  command.add_option("--depth-scale", a.depth_scale, "Stored depth units per metre")->group(kReadingGroup);
  command.add_option("--depth-encoding", a.depth_encoding, "plain, or rotated3 (16 bits rotated left by 3)")
      ->group(kReadingGroup);
  CLI::Option* const along_ray =
      add_switch(command, "--ray-length", a.ray_length, "Depth is the length of the ray, not z")->group(kReadingGroup);
  add_switch(command, "--no-ray-length", a.ray_length, "Depth is z, also where the sequence says otherwise", false)
      ->excludes(along_ray)
      ->group(kReadingGroup);
  command.add_option("--pose-convention", a.pose_convention, "c2w or w2c, opencv or opengl; for example w2c,opengl")
      ->group(kReadingGroup);
  command
      .add_option("--body-camera", a.body_camera,
                  "Pose of the camera on the body whose poses are recorded: tx ty tz qx qy qz qw, or 12 or 16 numbers")
      ->group(kReadingGroup);
  command
      .add_option("--max-dt", a.max_dt_s,
                  "Largest difference of stamps within a frame, seconds [" +
                      CLI::detail::to_string(SequenceOptions{}.max_dt_s) + "]")
      ->group(kReadingGroup);
  command
      .add_option("--stamp-offset", a.stamp_offset, "Added to the stamps of poses: seconds, or frames where numbered")
      ->group(kReadingGroup);
  command.add_option("--labels", a.labels, "Folder of label images")->group(kReadingGroup);
  command.add_option("--label-offset", a.label_offset, "Added to every label id")
      ->check(CLI::Range(-65535, 65535))
      ->group(kReadingGroup);
  command
      .add_option("--probs", a.probs,
                  "Folder of class probability images (docs/datasets.md#labels), or of confidences beside --labels")
      ->group(kReadingGroup);
  command.add_option("--classes", a.classes, "Class table (classes.yaml, or a CSV of id and name)")
      ->group(kReadingGroup);
  add_switch(command, "--bgr", a.bgr, "Colour images hold red and blue exchanged")->group(kReadingGroup);
  add_switch(command, "--no-color", a.no_color, "Do not read colour images")->group(kReadingGroup);
}

SequenceOptions resolve(const ReadingArguments& a, SequenceOptions reading, Problems& problems) {
  const auto read = [&](const std::string& text, const auto& step) {
    if (!text.empty()) problems.attempt_reading(step);
  };
  read(a.format, [&] {
    require_layout(a.format);
    reading.format = a.format;
  });
  if (!a.labels.empty()) reading.labels_dir = a.labels;
  if (!a.probs.empty()) reading.probs_dir = a.probs;
  if (!a.classes.empty()) reading.classes_file = a.classes;
  read(a.frames, [&] { reading.frames = parse_frame_selection(a.frames, "--frames"); });
  read(a.intrinsics, [&] { reading.intrinsics = parse_intrinsics(a.intrinsics, "--intrinsics"); });
  read(a.distortion, [&] { reading.distortion = parse_distortion(a.distortion, "--distortion"); });
  read(a.body_camera, [&] { reading.T_body_camera = parse_pose(a.body_camera, "--body-camera"); });
  read(a.pose_convention,
       [&] { reading.pose_convention = parse_pose_convention(a.pose_convention, "--pose-convention"); });
  read(a.depth_encoding, [&] { reading.depth_encoding = parse_depth_encoding(a.depth_encoding, "--depth-encoding"); });
  if (a.depth_scale) reading.depth_scale = a.depth_scale;
  if (a.ray_length) reading.depth_is_ray_length = a.ray_length;
  if (a.max_dt_s) reading.max_dt_s = *a.max_dt_s;
  if (a.stamp_offset) reading.pose_stamp_offset = *a.stamp_offset;
  if (a.label_offset) reading.label_offset = *a.label_offset;
  if (a.bgr) reading.bgr = *a.bgr;
  if (a.no_color) reading.read_color = !*a.no_color;
  const auto expect_above_zero = [&](double found, const std::string& where, const std::string& what) {
    problems.expect(std::isfinite(found) && found > 0, where, what, "a number above 0", number_text(found));
  };
  if (reading.depth_scale) expect_above_zero(*reading.depth_scale, "--depth-scale", "depth units per metre");
  expect_above_zero(reading.max_dt_s, "--max-dt", "seconds");
  problems.expect(std::isfinite(reading.pose_stamp_offset), "--stamp-offset", "offset", "a finite number",
                  number_text(reading.pose_stamp_offset));
  return reading;
}

SequenceOptions resolve(const ReadingArguments& arguments) {
  Problems problems;
  const SequenceOptions options = resolve(arguments, {}, problems);
  problems.throw_if_any();
  return options;
}

}  // namespace felt::apps
