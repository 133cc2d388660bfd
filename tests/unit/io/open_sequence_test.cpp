#include "io/sequence/open_sequence.h"

#include <catch2/catch.hpp>
#include <ctime>
#include <fstream>

#include "core/error.h"
#include "io/images/image_encode.h"
#include "io/sequence/skip_reasons.h"
#include "io/sequence/trajectory_file.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;
namespace fs = std::filesystem;

namespace {

void overwrite(const fs::path& path, const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

void truncate(const fs::path& path) { fs::resize_file(path, fs::file_size(path) / 2); }

}  // namespace

TEST_CASE("every layout is recognised and gives the same frames") {
  struct Case {
    const char* layout;
    void (*write)(const fs::path&, int);
    double depth_unit_m;
    int color_error;
  };
  const auto c = GENERATE(Case{"7scenes", write_seven_scenes, 1e-3, 0}, Case{"tum", write_tum, 2e-4, 0},
                          Case{"replica", write_replica, 1 / 6553.5, 12}, Case{"generic", write_generic, 5e-4, 0},
                          Case{"redwood", write_redwood, 1e-3, 0}, Case{"icl", write_icl, 1e-3, 0},
                          Case{"scannet", write_scannet, 1e-3, 0});
  TemporaryDirectory folder;
  const fs::path path = folder.path() / "ein Ordner \xc3\xbc";
  c.write(path, 3);
  const auto reader = open_sequence(path);
  CHECK(reader->info().layout == c.layout);
  CHECK(reader->info().recorded_frames == 3);
  CHECK(reader->info().has_color);
  REQUIRE(reader->size() == 3);
  for (int i = 0; i < 3; ++i) check_frame(frame_of(*reader, i), i, c.depth_unit_m, c.color_error);
  CHECK(open_sequence(path, {.format = c.layout})->size() == 3);
}

TEST_CASE("frame numbers sort as numbers and a selection keeps them") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 12);
  const auto reader = open_sequence(folder.path(), {.frames = {.first = 2, .last = 12, .step = 8}});
  REQUIRE(reader->size() == 2);
  CHECK(frame_of(*reader, 0).index == 2);
  CHECK(frame_of(*reader, 1).index == 10);
  CHECK(reader->info().recorded_frames == 12);
  CHECK_THROWS_AS(open_sequence(folder.path(), {.frames = {.first = 50}}), ConfigError);
}

TEST_CASE("labels and classes come with the sequence or from the folders the user names") {
  TemporaryDirectory folder;
  write_replica(folder.path(), 2);
  const auto own = open_sequence(folder.path());
  CHECK(own->info().has_labels);
  CHECK(own->info().has_instances);
  CHECK(own->info().classes.size() == 3);
  CHECK(own->info().classes.slot_of_id(0) == ClassTable::kNoSlot);
  CHECK(frame_of(*own, 1).labels == label_image());

  const fs::path other = folder.path() / "other";
  fs::create_directories(other);
  write_bytes(other / "00001.png", encode_png(Image<uint8_t>(kWidth, kHeight, 7)));
  write_text(other / "classes.yaml", "classes: [{id: 7, name: seven}]\n");
  const auto given = open_sequence(folder.path(), {.labels_dir = other, .classes_file = other / "classes.yaml"});
  CHECK(frame_of(*given, 0).labels.empty());
  CHECK(frame_of(*given, 1).labels == LabelImage(kWidth, kHeight, 7));
  CHECK(given->info().classes.at_slot(0).name == "seven");
  CHECK_THROWS_WITH(open_sequence(folder.path(), {.labels_dir = folder.path()}),
                    Catch::Contains("none of them of a frame"));
}

TEST_CASE("labels of the colour image's size are brought to the depth grid, those of another are refused") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  Image<uint8_t> twice(2 * kWidth, 2 * kHeight);
  for (int v = 0; v < 2 * kHeight; ++v)
    for (int u = 0; u < 2 * kWidth; ++u) twice(u, v) = uint8_t(1 + (u / 2) % 3);
  write_bytes(folder.path() / "labels" / "0.png", encode_png(twice));
  CHECK(skip_of(*open_sequence(folder.path()), 0).reason == "wrong-size label image");
  write_bytes(folder.path() / "color" / "0.png", encode_png(ColorImage(2 * kWidth, 2 * kHeight)));
  CHECK(frame_of(*open_sequence(folder.path()), 0).labels == label_image());
  write_bytes(folder.path() / "labels" / "0.png", encode_png(Image<uint8_t>(kHeight, kWidth, 1)));
  CHECK(skip_of(*open_sequence(folder.path()), 0).reason == "wrong-size label image");
}

TEST_CASE("colour of another size and camera is registered to the depth grid by its own intrinsics") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  // Twice the resolution and half the angle of view: the outer depth pixels see no colour.
  write_text(folder.path() / "sequence.yaml",
             "camera: {fx: 20, fy: 20, cx: 11.5, cy: 7.5, width: 24, height: 16}\ndepth_scale: 2000\n"
             "color_camera: {fx: 80, fy: 80, cx: 23.5, cy: 15.5, width: 48, height: 32}\n");
  ColorImage color(48, 32);
  for (int v = 0; v < 32; ++v)
    for (int u = 0; u < 48; ++u) color(u, v) = {uint8_t(u), uint8_t(v), 9, 255};
  write_bytes(folder.path() / "color" / "0.png", encode_png(color));
  const ColorImage seen = frame_of(*open_sequence(folder.path()), 0).color;
  CHECK(seen(0, 8).a == 0);
  // Depth pixel 14 looks along x/z = 2.5 / 20, which the colour camera sees at 23.5 + 80 / 8 = 33.5, nearest pixel 34.
  CHECK(seen(14, 8) == Rgba8{34, 18, 9, 255});
}

TEST_CASE("the pose convention and the depth scale can be told") {
  TemporaryDirectory folder;
  write_seven_scenes(folder.path(), 1);
  const Eigen::Matrix4d recorded = pose_at(0).matrix();
  const Eigen::Vector4d mirror(1, -1, -1, 1);
  const auto pose_as = [&](const char* convention) {
    const auto reader =
        open_sequence(folder.path(), {.pose_convention = parse_pose_convention(convention, "--pose-convention")});
    return frame_of(*reader, 0).T_world_camera.matrix();
  };
  CHECK(pose_as("camera-to-world").isApprox(recorded, 1e-9));
  CHECK(pose_as("world-to-camera").isApprox(recorded.inverse(), 1e-9));
  CHECK(pose_as("c2w,opengl").isApprox(recorded * mirror.asDiagonal(), 1e-9));
  CHECK(pose_as("w2c,opengl").isApprox(recorded.inverse() * mirror.asDiagonal(), 1e-9));
  for (const char* wrong : {"camera_to_world", "C2W", "c2w,w2c", "world-to-camera,opengl,opencv", ""})
    CHECK_THROWS_WITH(parse_pose_convention(wrong, "--pose-convention"),
                      Catch::Contains("c2w") && Catch::Contains("w2c") && Catch::Contains("opengl"));
  CHECK(parse_pose_convention("w2c,world-to-camera", "--pose-convention").world_to_camera);
  CHECK(frame_of(*open_sequence(folder.path(), {.depth_scale = 2000.0}), 0).depth_m(0, 0) == 0.5f);
  CHECK_THROWS_AS(open_sequence(folder.path(), {.depth_scale = 0.0}), ConfigError);
}

TEST_CASE("depth along the ray becomes depth along the optical axis") {
  TemporaryDirectory folder;
  write_seven_scenes(folder.path(), 1);
  const Frame plain = frame_of(*open_sequence(folder.path()), 0);
  const Frame ray = frame_of(*open_sequence(folder.path(), {.depth_is_ray_length = true}), 0);
  // Corner pixel: x/z = -11.5/20, y/z = -7.5/20.
  CHECK(ray.depth_m(0, 0) == Approx(plain.depth_m(0, 0) / std::sqrt(1 + 0.575 * 0.575 + 0.375 * 0.375)));
}

TEST_CASE("depth 0 and 65535 mean nothing measured, and rotated bits are turned back") {
  TemporaryDirectory folder;
  write_seven_scenes(folder.path(), 1);
  Image<uint16_t> stored(kWidth, kHeight, 1000);
  stored(0, 0) = 0, stored(1, 0) = 65535, stored(2, 0) = uint16_t(9000 << 3 | 9000 >> 13);
  write_bytes(folder.path() / "seq-01" / "frame-000000.depth.png", encode_png(stored));
  const DepthImage depth_m = frame_of(*open_sequence(folder.path()), 0).depth_m;
  CHECK(depth_m(0, 0) == 0);
  CHECK(depth_m(1, 0) == 0);
  CHECK(depth_m(3, 0) == 1.0f);
  const auto rotated =
      open_sequence(folder.path(), {.depth_scale = 10000.0, .depth_encoding = DepthEncoding::rotated3});
  CHECK(frame_of(*rotated, 0).depth_m(2, 0) == 0.9f);
}

TEST_CASE("a bad frame is skipped with a countable reason and the others are read") {
  TemporaryDirectory folder;
  write_seven_scenes(folder.path(), 4);
  const fs::path images = folder.path() / "seq-01", depth = images / "frame-000001.depth.png",
                 color = images / "frame-000001.color.png", pose = images / "frame-000001.pose.txt";
  std::string expected;
  SECTION("missing depth") {
    fs::remove(depth);
    expected = "missing depth image";
  }
  SECTION("truncated depth") {
    truncate(depth);
    expected = "truncated depth image";
  }
  SECTION("empty depth file") {
    overwrite(depth, "");
    expected = "truncated depth image";
  }
  SECTION("not an image") {
    overwrite(depth, "this is not an image");
    expected = "unknown format depth image";
  }
  SECTION("damaged bytes within the image") {
    std::fstream file(depth, std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(60) << "damage";
    file.close();
    expected = "unreadable depth image";
  }
  SECTION("wrong size") {
    write_bytes(depth, encode_png(Image<uint16_t>(kHeight, kWidth, 1000)));
    expected = "wrong-size depth image";
  }
  SECTION("depth in colour") {
    write_bytes(depth, encode_png(color_image(0)));
    expected = "wrong type depth image";
  }
  SECTION("depth all zero") {
    write_bytes(depth, encode_png(Image<uint16_t>(kWidth, kHeight)));
    expected = "depth all zero";
  }
  SECTION("a folder in place of the image") {
    fs::remove(depth);
    fs::create_directory(depth);
    expected = "unreadable depth image";
  }
  SECTION("a link to itself") {
    fs::remove(depth);
    fs::create_symlink(depth, depth);
    expected = "missing depth image";
  }
  SECTION("missing colour") {
    fs::remove(color);
    expected = "missing colour image";
  }
  SECTION("truncated colour") {
    truncate(color);
    expected = "truncated colour image";
  }
  SECTION("missing pose") {
    fs::remove(pose);
    expected = "missing pose";
  }
  SECTION("text in the pose") {
    overwrite(pose, "no pose here\n");
    expected = "unreadable pose";
  }
  SECTION("half a pose") {
    overwrite(pose, "1 0 0 0\n0 1 0 0\n");
    expected = "unreadable pose";
  }
  SECTION("decimal commas") {
    overwrite(pose, "1,0 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n");
    expected = "unreadable pose";
  }
  SECTION("minus infinity") {
    overwrite(pose, "-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n");
    expected = "non-finite pose";
  }
  SECTION("NaN") {
    overwrite(pose, "1 0 0 nan 0 1 0 0 0 0 1 0 0 0 0 1\n");
    expected = "non-finite pose";
  }
  SECTION("all zero") {
    overwrite(pose, "0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0\n");
    expected = "non-rigid pose";
  }
  SECTION("scaled") {
    overwrite(pose, "2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1\n");
    expected = "non-rigid pose";
  }
  SECTION("mirrored") {
    overwrite(pose, "-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n");
    expected = "non-rigid pose";
  }
  const auto reader = open_sequence(folder.path());
  REQUIRE(reader->size() == 4);
  const SkippedFrame skip = skip_of(*reader, 1);
  CHECK(skip.reason == expected);
  CHECK(skip.index == 1);
  CHECK(skip.detail.find("1") != std::string::npos);
  for (const int i : {0, 2, 3}) check_frame(frame_of(*reader, i), i, 1e-3, 0);
}

TEST_CASE("skipped frames are told by reason, and whether an image of theirs is broken") {
  CHECK(skipped_text({}).empty());
  CHECK(skipped_text({{kTruncatedDepth, 1}, {kMissingPose, 2}}) == "2 missing pose, 1 truncated depth image");
  for (const char* reason : {kTruncatedDepth, "unknown format label image", "wrong-size colour image"})
    CHECK(is_of_broken_image(reason));
  for (const char* reason : {kMissingDepth, kMissingColor, kMissingPose, kNonRigidPose, kDepthAllZero})
    CHECK_FALSE(is_of_broken_image(reason));
}

TEST_CASE("frames without colour are whole when colour is not asked for") {
  TemporaryDirectory folder;
  write_seven_scenes(folder.path(), 2);
  fs::remove(folder.path() / "seq-01" / "frame-000001.color.png");
  const auto reader = open_sequence(folder.path(), {.read_color = false});
  CHECK(frame_of(*reader, 0).color.empty());
  CHECK(frame_of(*reader, 1).color.empty());
}

TEST_CASE("a pose file with Windows line ends, a byte order mark and comments reads like any other") {
  TemporaryDirectory folder;
  write_seven_scenes(folder.path(), 1);
  write_text(folder.path() / "seq-01" / "frame-000000.pose.txt",
             "\xef\xbb\xbf# camera to world\r\n" + matrix_text(pose_at(0).matrix(), "\r\n") + "\r\n");
  CHECK(frame_of(*open_sequence(folder.path()), 0).T_world_camera.isApprox(pose_at(0), 1e-9));
}

TEST_CASE("a slightly skewed rotation is made orthonormal") {
  TemporaryDirectory folder;
  write_seven_scenes(folder.path(), 1);
  Eigen::Matrix4d skewed = pose_at(0).matrix();
  skewed.topLeftCorner<3, 3>() *= 0.9999;
  write_text(folder.path() / "seq-01" / "frame-000000.pose.txt", matrix_text(skewed, "\n"));
  const Eigen::Matrix3d R = frame_of(*open_sequence(folder.path()), 0).T_world_camera.linear();
  CHECK((R.transpose() * R).isApprox(Eigen::Matrix3d::Identity(), 1e-12));
}

TEST_CASE("a negative fy is refused with what to do about it") {
  TemporaryDirectory folder;
  write_icl(folder.path() / "icl", 1);
  write_text(folder.path() / "icl" / "intrinsics.txt", "20 0 11.5\n0 -20 7.5\n0 0 1\n");
  write_generic(folder.path() / "generic", 1);
  write_text(folder.path() / "generic" / "sequence.yaml",
             "camera: {fx: 20, fy: -20, cx: 11.5, cy: 7.5, width: 24, height: 16}\n");
  const auto hint = Catch::Contains("poses mirrored alike");
  for (const char* layout : {"icl", "generic"}) CHECK_THROWS_WITH(open_sequence(folder.path() / layout), hint);
  CHECK_THROWS_WITH(parse_intrinsics("20,-20,11.5,7.5", "--intrinsics"), hint);
  CHECK_THROWS_WITH(parse_intrinsics("20,0,11.5,7.5", "--intrinsics"), !hint);
  // The mirrored poses give the mirrored points.
  const Eigen::Matrix4d M = Eigen::Vector4d(1, -1, 1, 1).asDiagonal();
  const Eigen::Isometry3d T = pose_at(1);
  const Eigen::Quaterniond q(T.linear());
  const double n[] = {T.translation().x(), -T.translation().y(), T.translation().z(), -q.x(), q.y(), -q.z(), q.w()};
  CHECK(matrix_of_translation_quaternion(n).isApprox(M * T.matrix() * M, 1e-12));
}

TEST_CASE("one image of another size does not speak for the others") {
  TemporaryDirectory folder;
  write_generic(folder.path() / "stated", 4);
  write_seven_scenes(folder.path() / "unstated", 4);
  fs::path first = folder.path() / "unstated";
  for (const auto& entry : fs::recursive_directory_iterator(folder.path() / "unstated"))
    if (entry.path().filename().string().find("000000.depth") != std::string::npos) first = entry.path();
  for (const fs::path& image : {folder.path() / "stated" / "depth" / "0.png", first}) {
    REQUIRE(fs::is_regular_file(image));
    write_bytes(image, encode_png(Image<uint16_t>(12, 8, 1000)));
  }
  for (const char* name : {"stated", "unstated"}) {
    INFO(name);
    const auto reader = open_sequence(folder.path() / name);
    CHECK(reader->info().camera.width == kWidth);
    CHECK(skip_of(*reader, 0).reason == "wrong-size depth image");
    CHECK(std::holds_alternative<Frame>(reader->read(1)));
  }
}

TEST_CASE("sizes and numbers beyond all measure are refused, not cut") {
  TemporaryDirectory folder;
  write_redwood(folder.path(), 1);
  for (const char* width : {"1e300", ".nan", "-5"}) {
    write_text(
        folder.path() / "intrinsic.json",
        std::string("{\"width\": ") + width + ", \"height\": 16, \"fx\": 20, \"fy\": 20, \"cx\": 11.5, \"cy\": 7.5}");
    CHECK_THROWS_WITH(open_sequence(folder.path()), Catch::Contains("intrinsic.json") && Catch::Contains("width"));
  }
  write_redwood(folder.path(), 1);
  write_text(folder.path() / "trajectory.log", "1e300 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  CHECK_THROWS_WITH(open_sequence(folder.path()), Catch::Contains("trajectory.log:1"));
}

TEST_CASE("Open3D's name stands for the layout that it shares with redwood") {
  TemporaryDirectory folder;
  write_redwood(folder.path(), 2);
  CHECK(open_sequence(folder.path(), {.format = "open3d"})->info().layout == "redwood");
}

TEST_CASE("what cannot be opened says what was looked for") {
  TemporaryDirectory folder;
  CHECK_THROWS_WITH(open_sequence(folder.path() / "absent"), Catch::Contains("absent"));
  CHECK_THROWS_AS(open_sequence(folder.path() / "absent"), IoError);
  CHECK_THROWS_WITH(open_sequence(folder.path()), Catch::Contains("sequence.yaml") &&
                                                      Catch::Contains("groundtruth.txt") &&
                                                      Catch::Contains("traj.txt") && Catch::Contains("pose.txt"));
  CHECK_THROWS_WITH(open_sequence(folder.path(), {.format = "kitti360"}), Catch::Contains("7scenes"));
}

TEST_CASE("intrinsics that cannot belong to the images are refused with the file named") {
  TemporaryDirectory folder;
  write_seven_scenes(folder.path(), 1);
  const fs::path camera = folder.path() / "camera-intrinsics.txt";
  for (const char* text : {"585 0 320 0 585 240 0 0 1", "20 0 11.5 0 -20 7.5 0 0 1", "nan 0 11.5 0 20 7.5 0 0 1",
                           "20 20", "20 0 11.5 3 20 7.5 0 0 1", "0.2 0.2 11.5 7.5", "words"}) {
    write_text(camera, text);
    INFO(text);
    CHECK_THROWS_AS(open_sequence(folder.path()), FormatError);
    CHECK(frame_of(*open_sequence(folder.path(), {.intrinsics = parse_intrinsics("20,20,11.5,7.5", "--intrinsics")}), 0)
              .camera.fx == 20);
  }
  for (const char* text : {"", "1,2,3", "1,2,3,4,5", "0,20,1,1", "a,b,c,d", "1,2,3,inf"})
    CHECK_THROWS_AS(parse_intrinsics(text, "--intrinsics"), ConfigError);
}

TEST_CASE("a camera that does not fit is called the layout's default only where it is, with what to give instead") {
  TemporaryDirectory folder;
  write_tum(folder.path(), 1);
  const fs::path camera = folder.path() / "camera-intrinsics.txt";
  write_text(camera, "525 525 319.5 239.5\n");
  CHECK_THROWS_WITH(open_sequence(folder.path()), Catch::Contains("found fx 525") && !Catch::Contains("default"));
  fs::remove(camera);
  CHECK_THROWS_WITH(open_sequence(folder.path()),
                    Catch::EndsWith("found the layout's default 525, 525, 319.5, 239.5; give --intrinsics fx,fy,cx,cy "
                                    "or a camera-intrinsics.txt"));
  CHECK_THROWS_WITH(open_sequence(folder.path(), {.intrinsics = Intrinsics{525, 525, 319.5, 239.5}}),
                    Catch::Contains("found fx 525") && !Catch::Contains("default"));
  CHECK(open_sequence(folder.path(), {.intrinsics = Intrinsics{20, 20, 11.5, 7.5}})->info().camera.fx == 20);
}

TEST_CASE("a generic sequence reports every problem of its description at once") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 1);
  write_text(folder.path() / "sequence.yaml",
             "camera: {fx: 20, fy: -3, cx: 11.5, cy: 7.5, width: 24}\ndepth_scale: many\npose_convention: sideways\n"
             "depthscale: 5\n");
  try {
    open_sequence(folder.path());
    FAIL("was accepted");
  } catch (const ConfigError& fault) {
    const std::string text = fault.what();
    for (const char* part :
         {"sequence.yaml:1: fy", "height", "sequence.yaml:2: depth_scale", "'many'", "sideways", "'depthscale'"}) {
      INFO(text);
      CHECK(text.find(part) != std::string::npos);
    }
  }
  write_text(folder.path() / "sequence.yaml", "camera: {fx: 20\n");
  CHECK_THROWS_AS(open_sequence(folder.path()), ConfigError);
}

TEST_CASE("a stray frame number far from the others is refused instead of listing the gap") {
  TemporaryDirectory folder;
  write_replica(folder.path(), 2);
  fs::copy_file(folder.path() / "results" / "depth000000.png", folder.path() / "results" / "depth900000000000.png");
  CHECK_THROWS_WITH(open_sequence(folder.path()), Catch::Contains("900000000000"));
}

TEST_CASE("the stored scenes open with their labels and classes") {
  for (const auto& entry : fs::directory_iterator(felt::test::source_dir() / "data" / "scenes")) {
    if (!fs::exists(entry.path() / "sequence.yaml")) continue;
    INFO(entry.path());
    const auto reader = open_sequence(entry.path());
    CHECK(reader->info().layout == "generic");
    CHECK(!reader->info().classes.empty());
    CHECK(!frame_of(*reader, 0).labels.empty());
  }
}

TEST_CASE("a hundred thousand poses open within seconds") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 2);
  std::string poses;
  const std::string pose = matrix_text(pose_at(1).matrix(), " ");
  for (int i = 0; i < 100000; ++i) poses += std::to_string(i) + " " + pose + "\n";
  write_text(folder.path() / "poses.txt", poses);
  const std::clock_t start = std::clock();  // processor time: other programs do not count
  const auto reader = open_sequence(folder.path());
  CHECK(double(std::clock() - start) / CLOCKS_PER_SEC < 5);
  CHECK(reader->size() == 100000);
  CHECK(skip_of(*reader, 99999).reason == "missing depth image");
}
