#include "io/doctor/doctor.h"

#include <catch2/catch.hpp>

#include "bench/support/corrupt.h"
#include "tests/support/data.h"

using namespace felt;
using namespace felt::test;
namespace fs = std::filesystem;

namespace {

/// A room with every kind of image: 24 small noisy views of it.
fs::path room() { return source_dir() / "data" / "scenes" / "room"; }

const Finding* accused(const Examination& examination, const std::string& topic) {
  for (const Finding& finding : examination.findings)
    if (finding.faulty && finding.topic == topic) return &finding;
  return nullptr;
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
  for (const char* name : {"table_wall"}) {
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
