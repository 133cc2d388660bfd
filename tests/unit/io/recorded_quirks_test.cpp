// Recordings as people have them: parts of them, folders as shells complete them, stamps that were never set.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <iterator>

#include "core/error.h"
#include "io/doctor/doctor.h"
#include "io/doctor/file_check.h"
#include "io/images/image_decode.h"
#include "io/images/image_encode.h"
#include "io/sequence/convert.h"
#include "io/sequence/open_sequence.h"
#include "io/tables/class_table_file.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;
namespace fs = std::filesystem;

namespace {

template <typename T>
void append(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// A container of raw depth, 1.5 m, with these stamps, microseconds, and in every frame this colour image (PNG; none
/// where it is empty) of a camera `color_x_m` to the right of the depth camera.
std::string sens_container(const std::vector<uint64_t>& stamps, const std::string& color = "", float color_x_m = 0) {
  std::string bytes;
  append(bytes, uint32_t(4)), append(bytes, uint64_t(1));
  bytes += 's';
  const float identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const float camera[16] = {20, 0, 11.5f, 0, 0, 20, 7.5f, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  float color_pose[16];
  std::copy(std::begin(identity), std::end(identity), color_pose);
  color_pose[3] = color_x_m;
  append(bytes, camera), append(bytes, color_pose), append(bytes, camera), append(bytes, identity);
  append(bytes, int32_t(1)), append(bytes, int32_t(0));
  for (const int size : {kWidth, kHeight, kWidth, kHeight}) append(bytes, uint32_t(size));
  append(bytes, 1000.0f), append(bytes, uint64_t(stamps.size()));
  for (const uint64_t stamp : stamps) {
    append(bytes, identity), append(bytes, stamp), append(bytes, stamp);
    append(bytes, uint64_t(color.size())), append(bytes, uint64_t(kWidth * kHeight * 2));
    bytes += color;
    for (int i = 0; i < kWidth * kHeight; ++i) append(bytes, uint16_t(1500));
  }
  return bytes;
}

}  // namespace

TEST_CASE("a slash behind a folder and a dot for it change nothing: the camera file above is found") {
  TemporaryDirectory folder;
  write_seven_scenes(folder.path(), 1);
  const fs::path plain = folder.path() / "seq-01";
  for (const fs::path& path : {plain, plain / "", plain / ".", plain / ".." / "seq-01" / ""}) {
    INFO(path);
    CHECK(open_sequence(path)->info().camera.fx == 20);
  }
  const fs::path before = fs::current_path();
  fs::current_path(plain);
  const double fx = open_sequence(".")->info().camera.fx;
  fs::current_path(before);
  CHECK(fx == 20);
}

TEST_CASE("a missing depth image shifts no pose of a log that counts frames") {
  TemporaryDirectory folder;
  write_redwood(folder.path(), 5);
  fs::remove(folder.path() / "depth" / "00002.png");
  const auto reader = open_sequence(folder.path());
  REQUIRE(reader->size() == 4);
  for (int64_t i = 0; i < 4; ++i) {
    const Frame frame = frame_of(*reader, i);
    CHECK(frame.T_world_camera.isApprox(pose_at(int(frame.index)), 1e-9));
  }
  // The first images are no exception.
  fs::remove(folder.path() / "depth" / "00000.png");
  fs::remove(folder.path() / "color" / "00000.png");
  const auto beheaded = open_sequence(folder.path());
  for (int64_t i = 0; i < beheaded->size(); ++i)
    CHECK(frame_of(*beheaded, i).T_world_camera.isApprox(pose_at(int(beheaded->name(i).index)), 1e-9));
  CHECK(beheaded->info().notes.empty());
  write_redwood(folder.path(), 5);
  fs::remove(folder.path() / "depth" / "00002.png");
  // Every second image with a log of its own: by position.
  fs::remove(folder.path() / "depth" / "00001.png");
  fs::remove(folder.path() / "depth" / "00003.png");
  std::string log;
  for (int i = 0; i < 2; ++i) log += std::to_string(i) + " 0 0\n" + matrix_text(pose_at(i).matrix(), "\n") + "\n";
  write_text(folder.path() / "trajectory.log", log);
  CHECK(frame_of(*open_sequence(folder.path()), 1).T_world_camera.isApprox(pose_at(1), 1e-9));
}

TEST_CASE("some scans of a recording take their own lines of its poses, and options of cameras are refused") {
  TemporaryDirectory folder;
  std::string bytes, poses;
  for (int i = 0; i < 4000; ++i)
    for (const float value :
         {5 * std::cos(0.00157f * float(i)), 5 * std::sin(0.00157f * float(i)), 0.1f * float(i % 7), 0.5f})
      append(bytes, value);
  for (const char* name : {"000000.bin", "000003.bin"}) write_text(folder.path() / "velodyne" / name, bytes);
  for (int i = 0; i < 5; ++i) poses += "1 0 0 " + std::to_string(i) + " 0 1 0 0 0 0 1 0\n";
  write_text(folder.path() / "poses.txt", poses);
  const auto reader = open_sequence(folder.path());
  REQUIRE(reader->size() == 8);
  CHECK(frame_of(*reader, 4).T_world_camera.translation().x() == Approx(3));
  CHECK_THROWS_AS(open_sequence(folder.path(), {.intrinsics = Intrinsics{400, 400, 255, 255}}), ConfigError);
  CHECK_THROWS_AS(open_sequence(folder.path(), {.depth_scale = 2}), ConfigError);
  CHECK_THROWS_AS(open_sequence(folder.path(), {.pose_stamp_offset = 1}), ConfigError);
}

TEST_CASE("stamps of a container count where they ascend; frame numbers stand for others") {
  TemporaryDirectory folder;
  write_text(folder.path() / "a.sens", sens_container({1000000, 1040000, 1080000}));
  CHECK(list_sequence(folder.path() / "a.sens", {}).stamped);
  CHECK(frame_of(*open_sequence(folder.path() / "a.sens"), 1).stamp_s == Approx(1.04));
  write_text(folder.path() / "a.sens", sens_container({0, 0, 0}));
  CHECK_FALSE(list_sequence(folder.path() / "a.sens", {}).stamped);
  const auto reader = open_sequence(folder.path() / "a.sens");
  CHECK(frame_of(*reader, 2).stamp_s == 2);
  convert_sequence(*reader, folder.path() / "tum", {.layout = "tum"});
  CHECK(std::holds_alternative<Frame>(open_sequence(folder.path() / "tum")->read(2)));
}

TEST_CASE("colour of a container's camera beside its depth camera is taken where depth projects into it") {
  TemporaryDirectory folder;
  const auto png = encode_png(color_image(0));
  const std::string image(png.begin(), png.end());
  write_text(folder.path() / "one.sens", sens_container({1000000}, image));
  CHECK(frame_of(*open_sequence(folder.path() / "one.sens"), 0).color == color_image(0));
  // 5 cm to the right: a point at 1.5 m moves 20 * 0.05 / 1.5 = 2 / 3 pixels to the left.
  write_text(folder.path() / "beside.sens", sens_container({1000000}, image, 0.05f));
  const Frame frame = frame_of(*open_sequence(folder.path() / "beside.sens"), 0);
  for (int u = 2; u < kWidth; ++u) CHECK(int(frame.color(u, 3).r) == 10 * (u - 1));
}

TEST_CASE("a container cut short keeps its whole frames, and those that it lost are counted") {
  TemporaryDirectory folder;
  const fs::path path = folder.path() / "a.sens";
  const std::string whole = sens_container({1000000, 1040000, 1080000, 1120000, 1160000});
  constexpr size_t kFrameHeaderBytes = 96, kFrameBytes = kFrameHeaderBytes + 2 * kWidth * kHeight;
  const size_t two_frames = whole.size() - 3 * kFrameBytes;
  write_text(path, whole);
  CHECK(open_sequence(path)->info().notes.empty());
  for (const size_t more : {size_t(0), size_t(40), kFrameHeaderBytes + 100}) {
    INFO(more);
    write_text(path, whole.substr(0, two_frames + more));
    const auto reader = open_sequence(path);
    REQUIRE(reader->size() == 5);
    REQUIRE(reader->info().notes.size() == 1);
    CHECK_THAT(reader->info().notes[0], Catch::Contains("5 frames") && Catch::Contains("after 2"));
    CHECK(frame_of(*reader, 1).stamp_s == Approx(1.04));
    for (int64_t i = 2; i < 5; ++i) {
      const ReadResult read = reader->read(i);
      const auto* skip = std::get_if<SkippedFrame>(&read);
      REQUIRE(skip != nullptr);
      CHECK(skip->reason == (more > kFrameHeaderBytes && i == 2 ? "truncated depth image" : "missing depth image"));
    }
    const Finding finding = check_frames(list_sequence(path, {}));
    CHECK(finding.topic == "frames");
    CHECK(finding.faulty);
    CHECK_THAT(finding.belief, Catch::Contains("3 frames"));
  }
  // A count that is nonsense does not list frames without end.
  std::string endless = whole;
  endless[whole.size() - 5 * kFrameBytes - 1] = '\x10';  // the highest byte of the number of frames
  write_text(path, endless);
  CHECK(open_sequence(path)->size() <= 10005);
  // Nothing whole: said, not opened.
  write_text(path, whole.substr(0, whole.size() - 5 * kFrameBytes + 200));
  CHECK_THROWS_WITH(open_sequence(path), Catch::Contains("ends"));
}

TEST_CASE("depth that was no whole numbers is written in millimetres") {
  TemporaryDirectory folder;
  write_generic(folder.path() / "recording", 1);
  // As floating-point depth is read: metres.
  const auto reader = open_sequence(folder.path() / "recording", {.depth_scale = 1});
  write_bytes(folder.path() / "recording" / "depth" / "0.png", encode_png(Image<uint16_t>(kWidth, kHeight, 3)));
  CHECK(convert_sequence(*reader, folder.path() / "out", {}).written == 1);
  CHECK(open_sequence(folder.path() / "out")->info().depth_scale == 1000);
  CHECK(frame_of(*open_sequence(folder.path() / "out"), 0).depth_m(2, 2) == 3);
}

TEST_CASE("pixels without colour stay so in a copy") {
  ColorImage image(4, 2, Rgba8{10, 20, 30, 255});
  image(1, 1).a = 0;
  ColorImage read = decode_color(encode_png(image), "t");
  CHECK(read == image);
  // Alpha of 0 everywhere says nothing: some renderers leave it so.
  for (Rgba8& pixel : image) pixel.a = 0;
  read = decode_color(encode_png(image), "t");
  CHECK(read(0, 0) == Rgba8{10, 20, 30, 255});

  TemporaryDirectory folder;
  write_generic(folder.path() / "recording", 1);
  write_text(folder.path() / "recording" / "sequence.yaml",
             "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\ndepth_scale: 2000\n"
             "color_camera: {fx: 40, fy: 40, cx: 11.5, cy: 7.5, width: 24, height: 16}\n");
  const auto reader = open_sequence(folder.path() / "recording");
  REQUIRE(frame_of(*reader, 0).color(0, 0).a == 0);
  convert_sequence(*reader, folder.path() / "png", {});
  CHECK(frame_of(*open_sequence(folder.path() / "png"), 0).color == frame_of(*reader, 0).color);
  const ConvertResult lost = convert_sequence(*reader, folder.path() / "jpeg", {.jpeg_color = true});
  CHECK(lost.left_out == std::vector<std::string>{"which pixels have no colour"});
}

TEST_CASE("a colour camera of other images is refused, and one that is no camera") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  const std::string camera = "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\n";
  const auto opened = [&](const std::string& more) -> std::string {
    write_text(folder.path() / "sequence.yaml", camera + more);
    try {
      open_sequence(folder.path());
    } catch (const Error& fault) {
      return fault.what();
    }
    return "";
  };
  CHECK(opened("color_camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\n") == "");
  CHECK_THAT(opened("color_camera: {fx: 40, fy: 40, cx: 23.5, cy: 15.5, width: 48, height: 32}\n"),
             Catch::Contains("48 x 32") && Catch::Contains("24 x 16"));
  CHECK_THAT(opened("color_camera: none\n"), Catch::Contains("color_camera"));
  CHECK_THAT(opened("paths: [a, b]\n"), Catch::Contains("paths"));
}

TEST_CASE("the scale and size of a camera file count in TUM's layout too") {
  TemporaryDirectory folder;
  write_tum(folder.path(), 1);
  fs::remove(folder.path() / "camera-intrinsics.txt");
  const std::string camera = "fx: 20\nfy: 20\ncx: 11.5\ncy: 7.5\ndepth_scale: 2500\n";
  write_text(folder.path() / "camera.yaml", camera);
  CHECK(frame_of(*open_sequence(folder.path()), 0).depth_m(3, 3) == Approx(2 * depth_m_at(0, 3)));
  write_text(folder.path() / "camera.yaml", camera + "width: 640\nheight: 480\n");
  CHECK_THROWS_AS(open_sequence(folder.path()), FormatError);
}

TEST_CASE("the label offset moves the ids of probability stacks and detections, not names") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  const fs::path probs = folder.path() / "p";
  SequenceOptions options{.probs_dir = probs, .label_offset = 1};
  const auto first_id = [&] { return frame_of(*open_sequence(folder.path(), options), 0).probabilities.class_id; };
  Image<uint16_t> stack(kWidth, 2 * kHeight, 40000);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u) stack(u, v) = 1;
  fs::create_directories(probs);
  write_bytes(probs / "0.png", encode_png(stack));
  CHECK(first_id().front() == 2);
  fs::remove_all(probs);
  fs::create_directories(probs / "00000");
  write_bytes(probs / "00000" / "0_1_1.png", encode_png(Image<uint8_t>(kWidth, kHeight, 255)));
  auto ids = first_id();
  CHECK(std::count(ids.begin(), ids.end(), 2) > 0);
  fs::remove_all(probs);
  fs::create_directories(probs);
  write_bytes(probs / "frame-000000.wall.png", encode_png(Image<uint8_t>(kWidth, kHeight, 255)));
  ids = first_id();
  CHECK(std::count(ids.begin(), ids.end(), 1) > 0);
}

TEST_CASE("endings in capitals are endings, and a folder of labels without images is a note") {
  TemporaryDirectory folder;
  write_icl(folder.path(), 1);
  fs::rename(folder.path() / "color" / "0.png", folder.path() / "color" / "0.PNG");
  fs::create_directories(folder.path() / "labels");
  const auto reader = open_sequence(folder.path());
  CHECK(reader->info().has_color);
  REQUIRE(reader->info().notes.size() == 1);
  CHECK_THAT(reader->info().notes[0], Catch::Contains("labels"));
}

TEST_CASE("colour of Microsoft's scenes is brought from its own camera to the depth camera") {
  TemporaryDirectory folder;
  fs::create_directories(folder.path() / "seq-01");
  write_text(folder.path() / "camera-intrinsics.txt", "585 0 320\n0 585 240\n0 0 1\n");
  write_text(folder.path() / "seq-01" / "frame-000000.pose.txt", matrix_text(pose_at(0).matrix(), "\n"));
  write_bytes(folder.path() / "seq-01" / "frame-000000.depth.png", encode_png(Image<uint16_t>(640, 480, 1000)));
  ColorImage color(640, 480);
  for (int v = 0; v < 480; ++v)
    for (int u = 0; u < 640; ++u) color(u, v) = {uint8_t(u / 4), uint8_t(v / 4), 0, 255};
  write_bytes(folder.path() / "seq-01" / "frame-000000.color.png", encode_png(color));
  const Frame frame = frame_of(*open_sequence(folder.path()), 0);
  CHECK(frame.color(320, 240) == color(320, 240));
  CHECK(frame.color(20, 240) == color(51, 240));  // 320 - 300 * 525 / 585 = 50.8
}

TEST_CASE("a class table with a key twice is refused") {
  TemporaryDirectory folder;
  write_text(folder.path() / "classes.yaml", "classes: [{id: 1, id: 2, name: concrete}]\n");
  CHECK_THROWS_WITH(read_class_table(folder.path() / "classes.yaml"), Catch::Contains("'id' again"));
}

TEST_CASE("the doctor reads poses of a body with the camera's place on it") {
  TemporaryDirectory folder;
  const auto reader = open_sequence(source_dir() / "data" / "scenes" / "room");
  convert_sequence(*reader, folder.path() / "body", {});
  Eigen::Isometry3d T_body_camera = Eigen::Isometry3d::Identity();
  T_body_camera.linear() = Eigen::AngleAxisd(1.2, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  T_body_camera.translation() = Eigen::Vector3d(0.3, -0.2, 0.5);
  std::string poses;
  for (int64_t i = 0; i < reader->size(); ++i) {
    const Frame frame = frame_of(*reader, i);
    poses += std::to_string(frame.index) + " " +
             matrix_text((frame.T_world_camera * T_body_camera.inverse()).matrix(), " ") + "\n";
  }
  write_text(folder.path() / "body" / "poses.txt", poses);
  const Examination examination = examine_sequence(folder.path() / "body", {.T_body_camera = T_body_camera});
  CHECK_FALSE(examination.faulty());
}
