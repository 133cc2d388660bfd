#include <catch2/catch.hpp>
#include <filesystem>

#include "io/sequence/open_sequence.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
namespace fs = std::filesystem;

namespace {

SequenceInfo info_of(const fs::path& path, const SequenceOptions& options = {}) {
  return open_sequence(path, options)->info();
}
std::string of(const fs::path& path, const SequenceOptions& options = {}) { return info_of(path, options).fingerprint; }
std::string images(const std::string& fingerprint) { return fingerprint.substr(0, 16); }

}  // namespace

TEST_CASE("a recording has the same fingerprint wherever it lies and whatever of it is used, and another one has not") {
  const test::TemporaryDirectory folder;
  const fs::path a = folder.path() / "a", b = folder.path() / "b";
  test::write_generic(a, 4);
  fs::copy(a, b, fs::copy_options::recursive);
  const std::string fingerprint = of(a);
  CHECK(fingerprint.size() == 32);
  CHECK(of(b) == fingerprint);
  SequenceOptions part;
  part.frames = {1, 3, 1};
  CHECK(of(a, part) == fingerprint);
  SequenceOptions scaled;
  scaled.depth_scale = 500;
  CHECK(of(a, scaled) == fingerprint);
  CHECK(info_of(a, part).content == info_of(b).content);
  for (const auto& entry : fs::directory_iterator(b / "depth"))
    if (entry.path().stem().string().find('3') != std::string::npos) fs::resize_file(entry.path(), 100);
  CHECK(images(of(b)) != images(fingerprint));
}

TEST_CASE("a recording of eight frames or more keeps its fingerprint while it grows; its content is another one then") {
  const test::TemporaryDirectory folder;
  const fs::path recording = folder.path() / "recording";
  test::write_generic(recording, 8);
  const SequenceInfo before = info_of(recording);
  CHECK(before.content.size() == 32);
  CHECK(before.content != before.fingerprint);
  test::write_generic(recording, 9);
  CHECK(of(recording) == before.fingerprint);
  CHECK(info_of(recording).content != before.content);
}

TEST_CASE("the same images with other poses or stamps agree in the first half of the fingerprint") {
  const test::TemporaryDirectory folder;
  const fs::path generic = folder.path() / "generic", tum = folder.path() / "tum";
  test::write_generic(generic, 9);
  const std::string before = of(generic);
  std::string poses;
  for (int i = 0; i < 9; ++i)
    poses += std::to_string(i) + " " + test::matrix_text(test::pose_at(i + 3).matrix(), " ") + "\n";
  test::write_text(generic / "poses.txt", poses);
  CHECK(images(of(generic)) == images(before));
  CHECK(of(generic) != before);

  // Ten milliseconds later there is another pose.
  test::write_tum(tum, 9);
  CHECK(images(of(tum, {.pose_stamp_offset = -0.01})) == images(of(tum)));
  CHECK(of(tum, {.pose_stamp_offset = -0.01}) != of(tum));
  CHECK(images(of(tum)) != images(before));
}
