#include "io/sequence/convert.h"

#include <catch2/catch.hpp>

#include "core/error.h"
#include "io/files/text_input.h"
#include "io/images/depth_encode.h"
#include "io/images/image_encode.h"
#include "io/sequence/open_sequence.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;
namespace fs = std::filesystem;

TEST_CASE("a converted sequence gives the frames it was made of, in every layout") {
  const std::string layout = GENERATE(from_range(writable_layouts()));
  INFO(layout);
  TemporaryDirectory folder;
  write_generic(folder.path() / "recording", 3);
  const auto original = open_sequence(folder.path() / "recording");
  const fs::path out = folder.path() / "con verted";
  const ConvertResult result = convert_sequence(*original, out, {.layout = layout});
  CHECK(result.written == 3);
  CHECK(result.skipped.empty());
  CHECK(result.depth_out_of_range == 0);

  const auto converted = open_sequence(out);
  CHECK(converted->info().layout == layout);
  CHECK(converted->info().camera == original->info().camera);
  REQUIRE(converted->size() == 3);
  for (int64_t i = 0; i < 3; ++i) {
    const auto before = std::get<Frame>(original->read(i)), after = std::get<Frame>(converted->read(i));
    CHECK(after.T_world_camera.isApprox(before.T_world_camera, 1e-12));
    CHECK(after.color == before.color);
    for (size_t p = 0; p < before.depth_m.size(); ++p)
      REQUIRE(std::abs(after.depth_m.data()[p] - before.depth_m.data()[p]) < 0.51 / converted->info().depth_scale);
    if (converted->info().has_labels) CHECK(after.labels == before.labels);
  }
  if (converted->info().has_labels) CHECK(converted->info().classes == original->info().classes);
  CHECK(converted->info().has_labels == (layout != "tum" && layout != "redwood"));
}

TEST_CASE("a conversion keeps the property table and the touches, or says that it left them out") {
  TemporaryDirectory folder;
  write_generic(folder.path() / "recording", 2);
  write_text(folder.path() / "recording" / "properties.yaml", "friction: {priors: {ice: {mean: 0.2, sd: 0.05}}}\n");
  write_text(folder.path() / "recording" / "touches.csv", "frame,x,y,z,property,value\n0,0,0,1,friction,0.2\n");
  const auto original = open_sequence(folder.path() / "recording");
  const ConvertResult kept = convert_sequence(*original, folder.path() / "generic", {});
  CHECK(kept.left_out.empty());
  const auto converted = open_sequence(folder.path() / "generic");
  CHECK(converted->info().properties_file == folder.path() / "generic" / "properties.yaml");
  CHECK(read_whole_file(converted->info().touches_file) == read_whole_file(original->info().touches_file));
  // Of frames that are not written there can be no touches.
  write_text(folder.path() / "recording" / "touches.csv",
             "frame,x,y,z,property,value\n0,0,0,1,friction,0.2\n1,0,0,1,friction,0.3\n");
  const ConvertResult part =
      convert_sequence(*open_sequence(folder.path() / "recording", {.frames = {0, 1, 1}}), folder.path() / "part", {});
  CHECK(part.touches_elsewhere == 1);
  CHECK(part.left_out.empty());
  CHECK(read_whole_file(folder.path() / "part" / "touches.csv") ==
        "frame,x,y,z,property,value\n0,0,0,1,friction,0.2\n");
  write_text(folder.path() / "recording" / "touches.csv", "frame,x,y,z,property,value\n0,0,0,1,friction,0.2\n");
  const ConvertResult lost = convert_sequence(*original, folder.path() / "tum", {.layout = "tum"});
  CHECK(lost.left_out == std::vector<std::string>{"labels", "properties.yaml", "touches.csv"});
  CHECK_THROWS_AS(convert_sequence(*original, folder.path() / "fine", {.depth_scale = 1e9}), ConfigError);
}

TEST_CASE("conversion leaves nothing behind where it fails or is stopped, and replaces nothing") {
  TemporaryDirectory folder;
  write_generic(folder.path() / "recording", 2);
  const auto reader = open_sequence(folder.path() / "recording");
  const fs::path out = folder.path() / "out";
  convert_sequence(*reader, out, {}, [](int64_t) { return false; });
  CHECK_FALSE(fs::exists(out));
  CHECK_THROWS_AS(convert_sequence(*reader, out, {.layout = "nonsense"}), ConfigError);
  CHECK_THROWS_AS(convert_sequence(*reader, folder.path() / "recording", {}), IoError);
  CHECK(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()) == 1);
  // A folder of the user's whose name looks like one in progress.
  write_text(folder.path() / "out.partial" / "notes.txt", "mine");
  convert_sequence(*reader, out, {});
  CHECK(fs::exists(out / "poses.txt"));
  CHECK(fs::exists(folder.path() / "out.partial" / "notes.txt"));
}

TEST_CASE("a conversion keeps stamps where the layout has a place for them, or says that it has none") {
  TemporaryDirectory folder;
  write_tum(folder.path() / "recording", 4);
  const auto reader = open_sequence(folder.path() / "recording");
  for (const char* layout : {"generic", "tum"}) {
    CHECK(convert_sequence(*reader, folder.path() / layout, {.layout = layout}).left_out.empty());
    const auto converted = open_sequence(folder.path() / layout);
    REQUIRE(converted->size() == 4);
    for (int64_t i = 0; i < 4; ++i) CHECK(converted->name(i).stamp_s == Approx(reader->name(i).stamp_s).margin(1e-6));
  }
  CHECK(convert_sequence(*reader, folder.path() / "icl", {.layout = "icl"}).left_out ==
        std::vector<std::string>{"depth steps finer than 1 mm", "stamps"});
}

TEST_CASE("stamps in whole seconds are kept") {
  TemporaryDirectory folder;
  const fs::path recording = folder.path() / "recording";
  write_generic(recording, 3);
  std::string poses;
  for (int i = 0; i < 3; ++i)
    poses += std::to_string(1700000000 + 2 * i) + " " + matrix_text(pose_at(i).matrix(), " ") + "\n";
  write_text(recording / "poses.txt", poses);
  const auto reader = open_sequence(recording);
  REQUIRE(reader->name(1).stamp_s == 1700000002);
  CHECK(convert_sequence(*reader, folder.path() / "kept", {}).left_out.empty());
  CHECK(open_sequence(folder.path() / "kept")->name(2).stamp_s == 1700000004);
}

TEST_CASE("colour that a conversion registered to depth is not registered again") {
  TemporaryDirectory folder;
  const fs::path recording = folder.path() / "recording";
  constexpr int kWide = 640, kHigh = 480;
  fs::create_directories(recording / "seq-01");
  Image<Rgba8> colors(kWide, kHigh);
  for (int v = 0; v < kHigh; ++v)
    for (int u = 0; u < kWide; ++u) colors(u, v) = {uint8_t(u / 3), uint8_t(v / 2), 7, 255};
  write_bytes(recording / "seq-01" / "frame-000000.color.png", encode_png(colors));
  write_bytes(recording / "seq-01" / "frame-000000.depth.png", encode_png(Image<uint16_t>(kWide, kHigh, 1500)));
  write_text(recording / "seq-01" / "frame-000000.pose.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  const auto original = open_sequence(recording);
  const Frame frame = frame_of(*original, 0);
  CHECK(frame.color(100, 100).r != colors(100, 100).r);  // through another camera
  convert_sequence(*original, folder.path() / "converted", {.layout = "7scenes"});
  const Frame again = frame_of(*open_sequence(folder.path() / "converted"), 0);
  // Nor is a camera that is said another reason to take colour as it lies.
  const Frame said = frame_of(*open_sequence(recording, {.intrinsics = Intrinsics{585, 585, 320, 240}}), 0);
  const Frame refined = [&] {
    write_text(recording / "camera-intrinsics.txt", "585 0 320\n0 585 240\n0 0 1\n");
    return frame_of(*open_sequence(recording, {.intrinsics = Intrinsics{580, 580, 320, 240}}), 0);
  }();
  CHECK(refined.color(60, 60).r != colors(60, 60).r);
  for (const Frame* other : {&again, &said})
    for (const int at : {60, 100, 240, 400}) CHECK(other->color(at, at).r == frame.color(at, at).r);
}

TEST_CASE("another depth scale is stated where the layout can state one, and refused where it cannot") {
  TemporaryDirectory folder;
  write_generic(folder.path() / "recording", 2);
  const auto original = open_sequence(folder.path() / "recording");
  for (const std::string& layout : writable_layouts()) {
    INFO(layout);
    const fs::path out = folder.path() / layout;
    const ConvertOptions options{.layout = layout, .depth_scale = 2500};
    if (layout == "7scenes" || layout == "icl") {
      CHECK_THROWS_AS(convert_sequence(*original, out, options), ConfigError);
      CHECK_FALSE(fs::exists(out));
      CHECK(convert_sequence(*original, out, {.layout = layout, .depth_scale = 1000}).left_out.empty());
      continue;
    }
    convert_sequence(*original, out, options);
    for (const SequenceOptions& reading : {SequenceOptions{}, {.intrinsics = Intrinsics{21, 21, 11.5, 7.5}}}) {
      const auto converted = open_sequence(out, reading);
      CHECK(converted->info().depth_scale == 2500);
      CHECK(frame_of(*converted, 1).depth_m(7, 3) == Approx(depth_m_at(1, 7)).margin(0.51 / 2500));
    }
    CHECK(open_sequence(out)->info().camera == original->info().camera);
  }
}

TEST_CASE("a depth scale at which most of the measured depth is lost is an error that leaves nothing behind") {
  TemporaryDirectory folder;
  write_generic(folder.path() / "recording", 1);  // from 1 m to 1.23 m
  const auto reader = open_sequence(folder.path() / "recording");
  const fs::path out = folder.path() / "out";
  CHECK_THROWS_WITH(convert_sequence(*reader, out, {.depth_scale = 60000}),
                    Catch::Contains("384 measured pixels") && Catch::Contains("1.09 m"));
  CHECK_THROWS_AS(convert_sequence(*reader, out, {.depth_scale = 0.1}), FormatError);
  CHECK_FALSE(fs::exists(out));
  const ConvertResult result = convert_sequence(*reader, out, {.depth_scale = 55000});  // up to 1.19 m
  CHECK(result.depth_measured == kWidth * kHeight);
  CHECK(result.depth_out_of_range == 4 * kHeight);
}

TEST_CASE("what suits the sensor goes with a generic sequence, and is named where a layout cannot say it") {
  TemporaryDirectory folder;
  const fs::path recording = folder.path() / "recording";
  write_generic(recording, 1);
  const std::string description = read_whole_file(recording / "sequence.yaml");
  write_text(recording / "sequence.yaml", description + "voxel_size: 0.2\nmax_depth: 80\n");
  const auto reader = open_sequence(recording);
  CHECK(convert_sequence(*reader, folder.path() / "generic", {}).left_out.empty());
  const auto converted = open_sequence(folder.path() / "generic");
  CHECK(converted->info().voxel_size_m == 0.2);
  CHECK(converted->info().max_depth_m == 80);
  CHECK(convert_sequence(*reader, folder.path() / "replica", {.layout = "replica"}).left_out ==
        std::vector<std::string>{"the voxel size that suits the sensor", "the depth that the sensor reaches to"});
  write_text(recording / "sequence.yaml", description + "voxel_size: -1\nmax_depth: .inf\n");
  CHECK_THROWS_WITH(open_sequence(recording), Catch::Contains("voxel_size") && Catch::Contains("max_depth"));
}

TEST_CASE("depth that a layout stores more coarsely than the sequence is named, unless it was asked for") {
  TemporaryDirectory folder;
  write_tum(folder.path() / "recording", 1);
  const auto reader = open_sequence(folder.path() / "recording");
  const auto names_it = [&](const std::string& name, const ConvertOptions& options) {
    const std::vector<std::string> left_out = convert_sequence(*reader, folder.path() / name, options).left_out;
    return std::count(left_out.begin(), left_out.end(), "depth steps finer than 1 mm") == 1;
  };
  for (const char* layout : {"7scenes", "icl", "redwood"}) CHECK(names_it(layout, {.layout = layout}));
  CHECK_FALSE(names_it("replica", {.layout = "replica"}));
  CHECK_FALSE(names_it("asked", {.layout = "redwood", .depth_scale = 1000}));
}

TEST_CASE("a conversion without any frame says why there is none") {
  TemporaryDirectory folder;
  write_tum(folder.path() / "recording", 3);
  const auto reader = open_sequence(folder.path() / "recording", {.max_dt_s = 0.001});
  CHECK_THROWS_WITH(convert_sequence(*reader, folder.path() / "out", {}), Catch::Contains("3 missing pose"));
}

TEST_CASE("depth that does not fit into 16 bits is counted and stored as missing") {
  int64_t lost = 0;
  DepthImage depth(3, 1);
  depth(0, 0) = 1, depth(1, 0) = 14, depth(2, 0) = 0;
  const Image<uint16_t> stored = stored_depth(depth, 5000, lost);
  CHECK(stored(0, 0) == 5000);
  CHECK(stored(1, 0) == 0);
  CHECK(stored(2, 0) == 0);
  CHECK(lost == 1);
}
