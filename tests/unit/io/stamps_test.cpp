#include <catch2/catch.hpp>
#include <string>

#include "io/sequence/open_sequence.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;

TEST_CASE("TUM streams are matched by nearest stamp within the largest difference") {
  TemporaryDirectory folder;
  write_tum(folder.path(), 4);
  SECTION("no partner near enough") {
    const auto reader = open_sequence(folder.path(), {.max_dt_s = 0.0035});
    for (int i = 0; i < 4; ++i) CHECK(skip_of(*reader, i).reason == "missing pose");  // 4 ms away
  }
  SECTION("a colour image is missing from the list") {
    write_text(folder.path() / "rgb.txt", "100.003000 rgb/100.003000.png\n");
    const auto reader = open_sequence(folder.path());
    check_frame(frame_of(*reader, 0), 0, 2e-4, 0);
    CHECK(skip_of(*reader, 2).reason == "missing colour image");
  }
  SECTION("one stamp runs backward") {
    write_text(folder.path() / "depth.txt",
               "100.000000 depth/100.000000.png\n100.300000 depth/100.300000.png\n100.100000 depth/100.100000.png\n"
               "100.200000 depth/100.200000.png\n");
    const auto reader = open_sequence(folder.path());
    CHECK(skip_of(*reader, 1).reason == "stamp out of order");
    CHECK(frame_of(*reader, 2).T_world_camera.isApprox(pose_at(1), 1e-9));
    CHECK(frame_of(*reader, 3).T_world_camera.isApprox(pose_at(2), 1e-9));
  }
  SECTION("the same stamp twice") {
    write_text(folder.path() / "depth.txt", "100.000000 depth/100.000000.png\n100.000000 depth/100.000000.png\n");
    const auto reader = open_sequence(folder.path());
    CHECK(std::holds_alternative<Frame>(reader->read(0)) != std::holds_alternative<Frame>(reader->read(1)));
  }
  SECTION("a quaternion of no length") {
    write_text(folder.path() / "groundtruth.txt", "100.000 0 0 0 0 0 0 0\n");
    CHECK(skip_of(*open_sequence(folder.path()), 0).reason == "non-finite pose");
  }
}

TEST_CASE("stamps of TUM's layout that do not match are explained: ranges, difference, unit, options") {
  TemporaryDirectory folder;
  write_tum(folder.path(), 4);
  CHECK(open_sequence(folder.path())->info().notes.empty());
  const auto note_with = [&](const char* poses, const SequenceOptions& options) -> std::string {
    write_text(folder.path() / "groundtruth.txt", poses);
    const auto reader = open_sequence(folder.path(), options);
    return reader->info().notes.empty() ? "" : reader->info().notes.front();
  };
  CHECK_THAT(note_with("100004000000 1 2 3 0 0 0 1\n100304000000 1 2 3 0 0 0 1\n", {}),
             Catch::Contains("within 0.02 s") && Catch::Contains("100 to 100.3") &&
                 Catch::Contains("100004000000 to 100304000000") && Catch::Contains("4 of 4") &&
                 Catch::Contains("stamps of poses in nanoseconds?") && Catch::Contains("--stamp-offset") &&
                 Catch::Contains("--max-dt"));
  const char* later = "107.5 1 2 3 0 0 0 1\n108 1 2 3 0 0 0 1\n";
  CHECK_THAT(note_with(later, {}), Catch::Contains("smallest difference 7.2 s;"));
  CHECK_THAT(note_with(later, {.pose_stamp_offset = -3}),
             Catch::Contains("104.5 to 105") && Catch::Contains("smallest difference 4.2 s"));
  CHECK(note_with(later, {.max_dt_s = 0.2, .pose_stamp_offset = -7.5}).empty());
}

TEST_CASE("depth images without colour partner name the option that does without") {
  TemporaryDirectory folder;
  write_tum(folder.path(), 4);
  write_text(folder.path() / "rgb.txt", "100.003000 rgb/100.003000.png\n");
  const auto reader = open_sequence(folder.path());
  CHECK_THAT(skip_of(*reader, 2).detail, Catch::Contains("--no-color"));
  REQUIRE(reader->info().notes.size() == 1);
  CHECK_THAT(reader->info().notes[0], Catch::Contains("3 of 4") && Catch::Contains("--no-color"));
  CHECK(open_sequence(folder.path(), {.read_color = false})->info().notes.empty());
}

TEST_CASE("a pose whose stamp is no number is nobody's, also where stamps are shifted") {
  TemporaryDirectory folder;
  write_generic(folder.path(), 3);
  const std::string matrix = " 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n";
  write_text(folder.path() / "poses.txt", "nan" + matrix + "0.5" + matrix + "0.6" + matrix);
  SequenceOptions options;
  for (const double offset : {0.0, 0.05, -0.05}) {
    options.pose_stamp_offset = offset;
    const auto reader = open_sequence(folder.path(), options);
    CHECK(std::holds_alternative<SkippedFrame>(reader->read(0)));
  }
}
