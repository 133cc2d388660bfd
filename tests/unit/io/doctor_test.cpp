#include "io/doctor/doctor.h"

#include <catch2/catch.hpp>
#include <map>

#include "bench/support/corrupt.h"
#include "core/error.h"
#include "core/text.h"
#include "io/doctor/color_check.h"
#include "io/doctor/file_check.h"
#include "io/doctor/geometry_findings.h"
#include "io/doctor/label_check.h"
#include "io/doctor/sample.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;
namespace fs = std::filesystem;

namespace {

/// A room with every kind of image: 24 small noisy views of it.
fs::path room() { return source_dir() / "data" / "scenes" / "room"; }

const Finding* finding_of(const Examination& examination, const std::string& topic) {
  for (const Finding& finding : examination.findings)
    if (finding.topic == topic) return &finding;
  return nullptr;
}

const Finding* accused(const Examination& examination, const std::string& topic) {
  const Finding* finding = finding_of(examination, topic);
  return finding != nullptr && finding->faulty ? finding : nullptr;
}

std::string accused_topics(const Examination& examination) {
  std::string topics;
  for (const Finding& finding : examination.findings)
    if (finding.faulty) topics += finding.topic + " ";
  return topics;
}

/// The stored room with one fault, by the name that bench/support/corrupt.h gives it.
struct FaultyRoom {
  explicit FaultyRoom(const std::string& name) {
    corrupt::Copy copy = corrupt::sound_copy(room(), folder.path() / "base", 16);
    for (const corrupt::Fault& fault : corrupt::faults())
      if (fault.name == name) {
        topic = fault.topic;
        REQUIRE(fault.apply(copy));
      }
    REQUIRE_FALSE(topic.empty());
    path = folder.path() / "faulty";
    corrupt::write(copy, path, topic == "stamp-offset");
  }
  TemporaryDirectory folder;
  fs::path path;
  std::string topic;
};

/// The stored room with its poses changed one by one.
template <typename Change>
fs::path room_with_poses(const fs::path& folder, const Change& change) {
  corrupt::Copy copy = corrupt::sound_copy(room(), folder / "base", 16);
  for (size_t i = 0; i < copy.pose.size(); ++i) change(copy.pose[i], i);
  corrupt::write(copy, folder / "changed");
  return folder / "changed";
}

}  // namespace

TEST_CASE("the doctor accuses no sound sequence and proposes settings that suit its depth") {
  const Examination examination = examine_sequence(room());
  CHECK(accused_topics(examination) == "");
  CHECK_FALSE(examination.faulty());
  CHECK(examination.frame_pairs > 20);
  const MapProposal& proposal = examination.proposal;
  CHECK(proposal.median_depth_m > 1);
  CHECK(proposal.median_depth_m < 4);
  CHECK(proposal.max_depth_m >= proposal.far_depth_m);
  CHECK(proposal.voxel_size_m <= 3 * proposal.pixel_m * 1.001);
  CHECK(proposal.truncation_m >= 4 * proposal.voxel_size_m * 0.999);
  CHECK(accused_topics(examine_quickly(room())) == "");
}

TEST_CASE("the doctor accuses none of the stored scenes, however few and flat their views are") {
  for (const char* name : {"table_wall", "ice_crossing"}) {
    INFO(name);
    const fs::path scene = source_dir() / "data" / "scenes" / name;
    CHECK(accused_topics(examine_sequence(scene)) == "");
    CHECK(accused_topics(examine_quickly(scene)) == "");
  }
}

TEST_CASE("the four views of a scan are no copies of one another") {
  FELTMAP_REQUIRE_DATA(folder, "lidar_kitti");
  CHECK(accused_topics(examine_sequence(folder / "tp3d_000000.bin")) == "");
}

TEST_CASE("the doctor names a single fault of a sequence and the option that mends it") {
  struct Case {
    const char* fault;
    const char* remedy;
  };
  const auto c = GENERATE(
      Case{"inverse poses", "--pose-convention world-to-camera,opencv"},
      Case{"OpenGL axes", "--pose-convention camera-to-world,opengl"}, Case{"scale 1000", "--depth-scale 5000"},
      Case{"ray length", "--ray-length"}, Case{"BGR", "--bgr"}, Case{"cx and cy exchanged", "--intrinsics"},
      Case{"width and height exchanged", "--intrinsics"}, Case{"shuffled poses", ""}, Case{"repeated frames", ""},
      Case{"lost depth images", ""}, Case{"rotated depth bits", "--depth-encoding rotated3"});
  INFO(c.fault);
  const FaultyRoom room(c.fault);
  const Examination examination = examine_sequence(room.path);
  INFO(accused_topics(examination));
  const Finding* finding = accused(examination, room.topic);
  REQUIRE(finding != nullptr);
  CHECK(finding->confidence > 0.6);
  CHECK_FALSE(finding->evidence.empty());
  CHECK_THAT(finding->remedy, Catch::StartsWith(c.remedy));
}

TEST_CASE("a sequence is sound to the doctor once it is read with the option it named") {
  const FaultyRoom room("inverse poses");
  CHECK(accused(examine_quickly(room.path), "pose-convention") != nullptr);
  const SequenceOptions mended{.pose_convention = PoseConvention{.world_to_camera = true}};
  CHECK(accused_topics(examine_sequence(room.path, mended)) == "");
}

TEST_CASE("the doctor's remedies count from what is told already, so that they can be given in its place") {
  const auto remedy = [](const SequenceOptions& told, const char* topic) {
    const Examination examination = examine_sequence(room(), told);
    INFO(topic << ": " << accused_topics(examination));
    const Finding* finding = accused(examination, topic);
    REQUIRE(finding != nullptr);
    return finding->remedy;
  };
  CHECK(remedy({.bgr = true}, "color-order") == "leave out --bgr");
  CHECK(remedy({.depth_is_ray_length = true}, "depth-along") == "--no-ray-length");
  const std::string offset = remedy({.pose_stamp_offset = 1}, "stamp-offset"), option = "--stamp-offset ";
  REQUIRE_THAT(offset, Catch::StartsWith(option));
  CHECK(std::abs(std::stod(offset.substr(option.size()))) < 0.2);
}

TEST_CASE("the doctor's label offset counts from the one that is told") {
  // A wall across the view, whose labels are one above their class.
  GeometrySample sample;
  sample.camera = {.fx = 60, .fy = 60, .cx = 31.5, .cy = 23.5, .width = 64, .height = 48};
  sample.frames.emplace_back();
  sample.frames[0].depth_m = DepthImage(64, 48, 2.0f);
  sample.frames[0].labels = LabelImage(64, 48, uint16_t(6));
  sample.trajectory.position = {0};
  sample.trajectory.recorded = {Eigen::Isometry3d::Identity()};
  const ClassTable classes({{.id = 5, .name = "wall", .color = {}}});
  const auto remedy = [&](int told) { return check_labels(sample, {}, classes, told)->remedy; };
  CHECK(remedy(0) == "--label-offset -1");
  CHECK(remedy(3) == "--label-offset 2");
  CHECK(remedy(1) == "leave out --label-offset");
}

TEST_CASE("pale blue is the light's and exchanges nothing, deep blue all over does") {
  const auto finding = [](std::vector<Rgba8> colors) {
    std::vector<SampledFrame> frames;
    for (const Rgba8& color : colors) frames.emplace_back().color = ColorImage(64, 48, color);
    return *check_color_order(frames, ClassTable(), false);
  };
  const Rgba8 ice{206, 226, 238, 255}, blue{60, 90, 150, 255}, wood{150, 90, 60, 255};
  CHECK_FALSE(finding({ice, ice}).faulty);
  CHECK_THAT(finding({ice, ice}).belief, Catch::Contains("cannot be told"));
  CHECK(finding({ice, blue}).faulty);
  CHECK(finding({blue}).remedy == "--bgr");
  CHECK(finding({ice, ice, wood}).belief == "colours are RGB");
}

TEST_CASE("a camera exchanged against the evidence is not named, though it were the best") {
  SequenceListing listing = list_sequence(room());
  GeometrySample sample = take_sample(room(), {}, listing, {}).geometry;
  // The exchange takes the principal point nowhere, and tells nothing else.
  sample.camera.cx = sample.camera.cy = (sample.camera.cx + sample.camera.cy) / 2;
  Reading best = sample.now;
  best.swapped_camera = true;
  bool looked_at = false;
  for (const Finding& finding : geometry_findings(sample, best, false)) {
    if (finding.topic != "image-size") continue;
    looked_at = true;
    CHECK_FALSE(finding.faulty);
    CHECK(finding.remedy.empty());
  }
  CHECK(looked_at);
}

TEST_CASE("an assumed focal length that is wrong is no camera with width and height exchanged") {
  FELTMAP_REQUIRE_DATA(recording, "icl_livingroom_maskrcnn");
  const TemporaryDirectory folder;
  corrupt::sound_copy(recording, folder.path() / "few", 5);
  for (const double fx : {481.2, 420.0})
    CHECK(accused_topics(examine_quickly(folder.path() / "few", {.intrinsics = Intrinsics{fx, 480, 319.5, 239.5}})) ==
          "");
}

TEST_CASE("quaternions written w x y z are told from poses of another convention") {
  const TemporaryDirectory folder;
  const fs::path path = room_with_poses(folder.path(), [](Eigen::Isometry3d& T, size_t) {
    const Eigen::Quaterniond q(T.linear());
    T.linear() = Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()).toRotationMatrix();
  });
  CHECK(accused_topics(examine_sequence(path)) == "quaternions ");
  CHECK(accused_topics(examine_quickly(path)) == "quaternions ");
}

TEST_CASE("where no reading fits, the doctor accuses no part of it") {
  const TemporaryDirectory folder;
  const fs::path path = room_with_poses(folder.path(), [](Eigen::Isometry3d& T, size_t i) {
    T.translation() += 0.8 * std::sin(5.0 * double(i)) * T.linear().col(2);
    T.linear() = T.linear() * Eigen::AngleAxisd(2.4 * double(i), Eigen::Vector3d::UnitZ());
  });
  const Examination examination = examine_sequence(path);
  CHECK(accused_topics(examination) == "fit trajectory ");
  CHECK(accused_topics(examine_quickly(path)) == "fit ");
  for (const char* part : {"pose-convention", "camera-axes", "depth-scale", "depth-along", "focal-length"})
    CHECK(finding_of(examination, part) == nullptr);
}

TEST_CASE("few frames tell no delay, and the doctor says so") {
  const TemporaryDirectory folder;
  corrupt::sound_copy(room(), folder.path() / "few", 7);
  const Examination examination = examine_sequence(folder.path() / "few");
  const Finding* finding = finding_of(examination, "stamp-offset");
  REQUIRE(finding != nullptr);
  CHECK_FALSE(finding->faulty);
  CHECK(finding->confidence == 0.5);
  CHECK_THAT(finding->belief, Catch::Contains("cannot be told from 7 frames"));
}

TEST_CASE("the doctor looks at the selected frames only") {
  const TemporaryDirectory folder;
  const fs::path path = folder.path() / "room";
  corrupt::sound_copy(room(), path, 12);
  const std::vector<FrameRecord> recorded = list_sequence(path).frames;
  fs::copy_file(recorded.at(10).depth.path, recorded.at(11).depth.path, fs::copy_options::overwrite_existing);
  CHECK(accused(examine_sequence(path), "duplicates") != nullptr);
  const Examination examination = examine_sequence(path, {.frames = {.last = 11}});
  CHECK(accused(examination, "duplicates") == nullptr);
  CHECK(examination.recorded_frames == 12);
  CHECK(examination.selected_frames == 11);
  CHECK(examination.sampled_frames == 11);
  CHECK_THROWS_AS(examine_sequence(path, {.frames = {.first = 20}}), ConfigError);
}

TEST_CASE("what the doctor finds sound it does not call anything else") {
  SequenceListing listing = list_sequence(room());
  const GeometrySample sample = take_sample(room(), {}, listing, {}).geometry;
  const auto belief = [&](const Reading& best, const std::string& topic) -> std::string {
    for (const Finding& finding : geometry_findings(sample, best, true))
      if (finding.topic == topic && !finding.faulty) return finding.belief;
    return "";
  };
  Reading beside = sample.now;
  beside.focal_factor = 1.02, beside.depth_factor = 1.01, beside.pose_delay = 0.05;
  const std::string scale = "stored depth counts " + number_text(sample.depth_scale, "%.6g") + " a metre";
  for (const auto& [topic, right] : std::map<std::string, std::string>{
           {"depth-scale", scale},
           {"focal-length", "the given focal length is right"},
           {"stamp-offset", "poses are those of the moments at which depth was taken"}}) {
    INFO(topic);
    CHECK(belief(sample.now, topic) == right);
    CHECK_THAT(belief(beside, topic),
               Catch::StartsWith(right + ", within what sensors differ by (") && Catch::EndsWith(" fits best)"));
  }
}

TEST_CASE("frames that are skipped are not said to be there") {
  const TemporaryDirectory folder;
  write_tum(folder.path(), 4);
  const auto frames = [&](const SequenceOptions& options) {
    return check_frames(list_sequence(folder.path(), options));
  };
  CHECK(frames({}).belief == "all frames are there");
  write_text(folder.path() / "rgb.txt",
             "100.003000 rgb/100.003000.png\n100.103000 rgb/100.103000.png\n100.203000 rgb/100.203000.png\n");
  CHECK_FALSE(frames({}).faulty);
  CHECK(frames({}).belief ==
        "every depth image is there; 1 of 4 frames are skipped as they have no colour of their own (--no-color uses "
        "them)");
  CHECK(frames({.read_color = false}).belief == "all frames are there");
}

TEST_CASE("scans without poses want a pose file, not another copy") {
  const TemporaryDirectory folder;
  for (const char* name : {"000000.bin", "000001.bin"}) {
    const std::string points(32, name[5]);
    write_bytes(folder.path() / name, {points.begin(), points.end()});
  }
  const Examination examination = examine_sequence(folder.path());
  const Finding* finding = accused(examination, "frames");
  REQUIRE(finding != nullptr);
  CHECK_THAT(finding->remedy, Catch::StartsWith("add poses.txt"));
}

TEST_CASE("shares are written as whole per cents from ten up") {
  CHECK(percent_text(1) == "100 %");
  CHECK(percent_text(0.996) == "100 %");
  CHECK(percent_text(0.123) == "12 %");
  CHECK(percent_text(0.041) == "4.1 %");
  CHECK(percent_text(0.000026) == "0.0026 %");
}

TEST_CASE("a reading in use that fits is not said to fit nowhere, though a search ended elsewhere") {
  SequenceListing listing = list_sequence(room());
  const GeometrySample sample = take_sample(room(), {}, listing, {}).geometry;
  Reading astray = sample.now;
  astray.depth_factor = 50;
  for (const Finding& finding : geometry_findings(sample, astray, false)) {
    INFO(finding.topic);
    CHECK_FALSE(finding.faulty);
    CHECK(finding.topic != "fit");
  }
}

TEST_CASE("the doctor names frames whose images cannot be read") {
  const TemporaryDirectory folder;
  const fs::path path = folder.path() / "room";
  corrupt::sound_copy(room(), path, 8);
  const std::vector<FrameRecord> frames = list_sequence(path).frames;
  for (const size_t broken : {2, 5}) fs::resize_file(frames.at(broken).depth.path, 200);
  const Examination some = examine_sequence(path);
  const Finding* finding = accused(some, "frames");
  REQUIRE(finding != nullptr);
  CHECK_THAT(finding->belief, Catch::StartsWith("2 sampled frames have images"));
  CHECK_THAT(finding->evidence, Catch::Contains("depth image in sampled frames 2, 5"));
  for (const FrameRecord& frame : frames) fs::resize_file(frame.depth.path, 200);
  const Examination none = examine_sequence(path);
  finding = accused(none, "frames");
  REQUIRE(finding != nullptr);
  CHECK(finding->belief == "no sampled frame can be read");
}
