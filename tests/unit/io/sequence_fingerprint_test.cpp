#include <catch2/catch.hpp>
#include <filesystem>

#include "io/sequence/open_sequence.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

using namespace felt;
namespace fs = std::filesystem;

TEST_CASE("a recording has the same fingerprint wherever it lies and whatever of it is used, and another one has not") {
  const test::TemporaryDirectory folder;
  const fs::path a = folder.path() / "a", b = folder.path() / "b";
  test::write_generic(a, 4);
  fs::copy(a, b, fs::copy_options::recursive);
  const auto of = [](const fs::path& path, const SequenceOptions& options = {}) {
    return open_sequence(path, options)->info().fingerprint;
  };
  const std::string fingerprint = of(a);
  CHECK(fingerprint.size() == 32);
  CHECK(of(b) == fingerprint);
  SequenceOptions part;
  part.frames = {1, 3, 1};
  CHECK(of(a, part) == fingerprint);
  SequenceOptions scaled;
  scaled.depth_scale = 500;
  CHECK(of(a, scaled) == fingerprint);

  test::write_generic(folder.path() / "longer", 5);
  CHECK(of(folder.path() / "longer") != fingerprint);
  for (const auto& entry : fs::directory_iterator(b / "depth"))
    if (entry.path().stem().string().find('3') != std::string::npos) fs::resize_file(entry.path(), 100);
  CHECK(of(b) != fingerprint);
}
