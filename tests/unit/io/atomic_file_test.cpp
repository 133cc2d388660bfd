#include "io/files/atomic_file.h"

#include <sys/resource.h>
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <fstream>
#include <iterator>

#include "core/error.h"
#include "tests/support/data.h"

using namespace felt;
namespace fs = std::filesystem;

namespace {

std::string content(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

size_t entries(const fs::path& folder) {
  return size_t(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

}  // namespace

TEST_CASE("a committed file has its content under its name, and nothing else is left in the folder") {
  const test::TemporaryDirectory folder;
  const fs::path target = folder.path() / "map.vdb";
  {
    AtomicFile file(target);
    CHECK(file.path().extension() == ".vdb");
    CHECK(file.path().parent_path() == folder.path());
    file.write("ab");
    file.write("cd");
    CHECK_FALSE(fs::exists(target));
    file.commit();
  }
  CHECK(content(target) == "abcd");
  CHECK(entries(folder.path()) == 1);
}

TEST_CASE("a file that is never committed leaves the older file as it was") {
  const test::TemporaryDirectory folder;
  const fs::path target = folder.path() / "report.json";
  write_file_atomically(target, "old");
  {
    AtomicFile file(target);
    file.write("new and unfinished");
  }
  CHECK(content(target) == "old");
  CHECK(entries(folder.path()) == 1);
}

TEST_CASE("a library may write the temporary file under its path") {
  const test::TemporaryDirectory folder;
  AtomicFile file(folder.path() / "x.png");
  std::ofstream(file.path(), std::ios::binary) << "pixels";
  file.commit();
  CHECK(content(folder.path() / "x.png") == "pixels");
}

TEST_CASE("a link that leads to nothing yet names the file that is made, and a ring of links names none") {
  const test::TemporaryDirectory folder;
  fs::create_directory(folder.path() / "there");
  const fs::path link = folder.path() / "link.ply", ring = folder.path() / "ring.ply";
  fs::create_symlink("there/real.ply", link);
  write_file_atomically(link, "new");
  CHECK(fs::is_symlink(link));
  CHECK(fs::is_regular_file(folder.path() / "there" / "real.ply"));
  fs::create_symlink("ring.ply", ring);
  CHECK_THROWS_AS(write_file_atomically(ring, "new"), IoError);
  CHECK(fs::is_symlink(ring));
}

TEST_CASE("a replaced file keeps its permissions, and a link stays a link") {
  const test::TemporaryDirectory folder;
  const fs::path real = folder.path() / "real.ply", link = folder.path() / "link.ply";
  write_file_atomically(real, "old");
  fs::permissions(real, fs::perms::owner_read | fs::perms::owner_write);
  fs::create_symlink(real, link);
  write_file_atomically(link, "new");
  CHECK(fs::is_symlink(link));
  CHECK(content(real) == "new");
  CHECK(fs::status(real).permissions() == (fs::perms::owner_read | fs::perms::owner_write));
}

TEST_CASE("an output that cannot be created is refused with the path and the reason") {
  const test::TemporaryDirectory folder;
  using Catch::Matchers::Contains;
  CHECK_THROWS_WITH(AtomicFile(folder.path() / "absent" / "x.ply"),
                    Contains("absent/x.ply") && Contains("No such file or directory"));
  CHECK_THROWS_WITH(AtomicFile(folder.path()), Contains("a folder"));
  CHECK_THROWS_WITH(AtomicFile("/dev/full"), Contains("a special file"));
  CHECK_THROWS_AS(AtomicFile(""), IoError);
}

TEST_CASE("a write that does not fit is an error, and the older file survives it") {
  const test::TemporaryDirectory folder;
  const fs::path target = folder.path() / "mesh.ply";
  write_file_atomically(target, "old");
  // A limit on the file size stands in for a full disk: the same call fails half way.
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{1 << 16, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &limit);
  const std::string large(1 << 20, 'x');
  std::string message;
  try {
    write_file_atomically(target, large);
  } catch (const IoError& error) {
    message = error.what();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  CHECK_THAT(message, Catch::Matchers::Contains("mesh.ply: cannot write"));
  CHECK(content(target) == "old");
  CHECK(entries(folder.path()) == 1);
}

TEST_CASE("what a killed writer left is removed, what is being written and other files stay") {
  const test::TemporaryDirectory folder;
  const fs::path target = folder.path() / "map.vdb";
  std::ofstream(folder.path() / "map.part-99-0.vdb") << "half";
  std::ofstream(folder.path() / "map.part-99-0.ply") << "another destination's";
  std::ofstream(folder.path() / "other.part-99-0.vdb") << "another destination's";
  AtomicFile file(target);
  file.write("whole");
  remove_abandoned_parts(target);
  CHECK_FALSE(fs::exists(folder.path() / "map.part-99-0.vdb"));
  CHECK(entries(folder.path()) == 3);
  file.commit();
  CHECK(content(target) == "whole");
}

TEST_CASE("a folder that vanishes before the file is whole is an error, not a file somewhere else") {
  const test::TemporaryDirectory folder;
  fs::create_directory(folder.path() / "a");
  AtomicFile file(folder.path() / "a" / "map.vdb");
  file.write("content");
  fs::remove_all(folder.path() / "a");
  CHECK_THROWS_WITH(file.commit(), Catch::Matchers::Contains("No such file or directory"));
  CHECK(fs::is_empty(folder.path()));
}
