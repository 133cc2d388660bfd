#include "io/settings/reconstruct_config.h"

#include <catch2/catch.hpp>

#include "core/error.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
using namespace felt::test;

TEST_CASE("a configuration sets what it names and leaves the rest open") {
  TemporaryDirectory folder;
  const auto file = folder.path() / "config.yaml";
  write_text(folder.path() / "classes.yaml", "classes: [{id: 1, name: wall}]\n");
  write_text(
      file,
      "voxel_size: 0.01\ntruncation: 4vox\nmax-depth: 3.5\nframes: 0:100:2\nintrinsics: [525, 525, 319.5, 239.5]\n"
      "weight: sensor-noise\ncarve: true\nthreads: 2\nclasses: classes.yaml\npose_convention: w2c,opengl\n"
      "bgr: true\nlabel_offset: -1\nstamp-offset: -0.02\ndistortion: 0.1,0.01,0,0\nbody_camera: 1 2 3 0 0 0 1\n"
      "segmenter: classes.yaml\ntop: 3\nvote: geometric\nmasks: .\nsegment_color: 12.5\ncheckpoint: 100\n");
  const ReconstructConfig config = read_reconstruct_config(file);
  CHECK(config.voxel_size_m == 0.01);
  CHECK(parse_truncation(*config.truncation, *config.voxel_size_m, "truncation") == Approx(0.04));
  CHECK(config.max_depth_m == 3.5);
  CHECK(config.frames == FrameSelection{0, 100, 2});
  CHECK(config.intrinsics->cx == 319.5);
  CHECK(config.weight == WeightModel::sensor_noise);
  CHECK(config.carve == true);
  CHECK(config.threads == 2);
  CHECK(config.classes == folder.path() / "classes.yaml");
  CHECK(config.pose_convention == PoseConvention{true, true});
  CHECK(config.bgr == true);
  CHECK(config.label_offset == -1);
  CHECK(config.stamp_offset == -0.02);
  CHECK(config.perception.network == folder.path() / "classes.yaml");
  CHECK(config.perception.top == 3);
  CHECK(config.perception.vote == SegmentSource::geometric);
  CHECK(config.perception.masks == folder.path() / ".");
  CHECK(config.perception.color_step == 12.5);
  CHECK(config.checkpoint_every == 100);
  REQUIRE(config.distortion);
  CHECK(config.distortion->k1 == 0.1);
  REQUIRE(config.T_body_camera);
  CHECK(config.T_body_camera->translation().z() == 3);
  CHECK(!config.min_depth_m);
  CHECK(!config.distance);
  CHECK(!config.depth_scale);
}

TEST_CASE("every problem of a configuration is reported at once with its line and key") {
  TemporaryDirectory folder;
  const auto file = folder.path() / "config.yaml";
  write_text(
      file,
      "voxel_size: 0\nvoxelsize: 1\ntruncation: wide\nmax_depth: [1, 2]\nframes: 5\nweight: heavy\ncarve: maybe\n"
      "threads: -1\nlabels: nowhere\nmax_dt: 0,02\nmax_depth: 3\nintrinsics: [1, 2]\n"
      "top: 65\nvote: loud\nsegment_color: 451\nsegmenter: nowhere\ncheckpoint: -1\nconfusion: ''\n");
  try {
    read_reconstruct_config(file);
    FAIL("was accepted");
  } catch (const ConfigError& fault) {
    const std::string text = fault.what();
    INFO(text);
    for (const char* part : {"config.yaml:1: voxel_size",
                             "config.yaml:2: key: expected 'voxel_size', found 'voxelsize'",
                             "config.yaml:3: truncation",
                             "config.yaml:4: max_depth",
                             "config.yaml:5: frames",
                             "config.yaml:6: weight",
                             "inverse-square",
                             "config.yaml:7: carve",
                             "config.yaml:8: threads",
                             "config.yaml:9: labels",
                             "config.yaml:10: max_dt",
                             "config.yaml:11: key: expected each once",
                             "config.yaml:12: intrinsics",
                             "config.yaml:13: top",
                             "config.yaml:14: vote",
                             "geometric, instances, none",
                             "config.yaml:18: confusion: value: expected a path, found nothing",
                             "config.yaml:15: segment_color",
                             "from 0 to 450",
                             "config.yaml:16: segmenter",
                             "config.yaml:17: checkpoint"})
      CHECK_THAT(text, Catch::Contains(part));
  }
}

TEST_CASE("a configuration that is no YAML or no table is refused with its line") {
  TemporaryDirectory folder;
  const auto file = folder.path() / "config.yaml";
  write_text(file, "voxel_size: 0.02\nframes: [1, 2\n");
  CHECK_THROWS_WITH(read_reconstruct_config(file), Catch::Contains("config.yaml:"));
  write_text(file, "- voxel_size\n");
  CHECK_THROWS_AS(read_reconstruct_config(file), ConfigError);
  CHECK_THROWS_AS(read_reconstruct_config(folder.path() / "absent.yaml"), IoError);
  write_text(file, "");
  CHECK(!read_reconstruct_config(file).voxel_size_m);
}

TEST_CASE("a truncation is metres or voxels") {
  CHECK(parse_truncation("0.08", 0.02, "--truncation") == 0.08);
  CHECK(parse_truncation("0.08m", 0.02, "--truncation") == 0.08);
  CHECK(parse_truncation("4vox", 0.02, "--truncation") == 0.08);
  for (const char* text : {"", "vox", "-1", "4 voxels", "nan", "inf", "0"})
    CHECK_THROWS_AS(parse_truncation(text, 0.02, "--truncation"), ConfigError);
}
