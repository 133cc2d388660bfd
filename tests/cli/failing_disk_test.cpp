// What a full, read-only or vanished target leaves behind: the file that was there before, whole.
#include <sys/mount.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "tests/cli/command.h"
#include "tests/cli/sequences.h"
#include "tests/support/data.h"

namespace felt::test {
namespace {
namespace fs = std::filesystem;
using Catch::Matchers::Contains;

/// A file system in memory; `good` is false, and the test noted as skipped, where mounting is not permitted.
class SmallDisk {
public:
  explicit SmallDisk(const fs::path& folder) : folder_(folder) {
    fs::create_directories(folder);
    good = mount("tmpfs", folder.c_str(), "tmpfs", 0, nullptr) == 0;
    if (!good) skip(std::string("no small disk can be mounted here: ") + std::strerror(errno));
  }
  ~SmallDisk() {
    if (good) umount2(folder_.c_str(), MNT_DETACH);
  }
  void limit(size_t bytes) const { remount(0, "size=" + std::to_string(bytes)); }
  void make_read_only() const { remount(MS_RDONLY, ""); }
  bool good = false;

private:
  void remount(unsigned long flags, const std::string& options) const {
    REQUIRE(mount(nullptr, folder_.c_str(), nullptr, MS_REMOUNT | flags, options.c_str()) == 0);
  }
  fs::path folder_;
};

std::map<std::string, std::string> files_in(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    std::ostringstream text;
    text << std::ifstream(entry.path(), std::ios::binary).rdbuf();
    files[entry.path().filename()] = text.str();
  }
  return files;
}

std::string reconstruct(const fs::path& out, const std::string& options) {
  return "reconstruct " + quoted(boxes()) + " --out " + quoted(out) + " --quiet " + options;
}

void require_refused(const std::string& arguments, const std::string& reason) {
  const CommandResult result = run_feltmap(arguments);
  INFO(arguments << "\n" << result.err);
  CHECK(result.exit_code == 4);
  CHECK_THAT(result.err, Contains(reason));
}

}  // namespace

TEST_CASE("on a full disk every command that writes fails with the reason and leaves the earlier files as they were") {
  const TemporaryDirectory folder;
  const fs::path disk = folder.path() / "disk", large = folder.path() / "large";
  const SmallDisk small(disk);
  if (!small.good) return;
  REQUIRE(run_feltmap(reconstruct(large, "--voxel-size 0.02")).exit_code == 0);
  REQUIRE(run_feltmap(reconstruct(folder.path() / "small", "--voxel-size 0.05")).exit_code == 0);
  size_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(folder.path() / "small")) bytes += entry.file_size();
  small.limit(bytes + (64 << 10));
  REQUIRE(run_feltmap(reconstruct(disk, "--voxel-size 0.05")).exit_code == 0);
  const auto before = files_in(disk);
  REQUIRE(before.size() == 3);
  const std::string full = "No space left on device", map = quoted(large / "map.vdb");
  require_refused(reconstruct(disk, "--voxel-size 0.02 --force"), full);
  CHECK((files_in(disk) == before));
  require_refused("merge " + map + " --force --out " + quoted(disk / "map.vdb"), full);
  require_refused("export " + map + " --vdb " + quoted(disk / "new.vdb"), full);
  require_refused("export " + map + " --vdb " + quoted(disk / "new.vdb") + " --grids tsdf,weight,color", full);
  require_refused("export " + map + " --mesh " + quoted(disk / "mesh.ply") + " --force", full);
  require_refused("export " + map + " --mesh " + quoted(disk / "mesh.glb"), full);
  CHECK((files_in(disk) == before));
  // Checkpoints that do not fit are skipped with a warning; the end fails.
  const CommandResult checkpoints = run_feltmap(reconstruct(disk, "--voxel-size 0.02 --force --checkpoint 6"));
  CHECK(checkpoints.exit_code == 4);
  CHECK_THAT(checkpoints.err, Contains("no checkpoint"));
  CHECK((files_in(disk) == before));
}

TEST_CASE("the map comes before the mesh where both do not fit, and an earlier mesh stays beside its map") {
  const TemporaryDirectory folder;
  const fs::path disk = folder.path() / "disk", other = folder.path() / "other", large = folder.path() / "large";
  const SmallDisk small(disk), small_too(other);
  if (!small.good || !small_too.good) return;
  REQUIRE(run_feltmap(reconstruct(large, "--voxel-size 0.02")).exit_code == 0);
  REQUIRE(run_feltmap(reconstruct(folder.path() / "small", "--voxel-size 0.05")).exit_code == 0);
  const auto size_of = [&](const char* file) { return size_t(fs::file_size(large / file)); };
  size_t held = 0;
  for (const auto& [name, text] : files_in(folder.path() / "small")) held += text.size();
  REQUIRE(size_of("mesh.ply") + (128 << 10) < size_of("map.vdb"));
  {
    // Room for the mesh and not for the map, which comes first and fails.
    small.limit(held + size_of("mesh.ply") + (64 << 10));
    REQUIRE(run_feltmap(reconstruct(disk, "--voxel-size 0.05")).exit_code == 0);
    const auto before = files_in(disk);
    for (const char* threads : {"1", "2"}) {
      const CommandResult result =
          run_feltmap(reconstruct(disk, "--voxel-size 0.02 --force --threads " + std::string(threads)));
      INFO(result.err);
      CHECK(result.exit_code == 4);
      CHECK_THAT(result.err, Contains("map.vdb") && Contains("No space left on device") && !Contains("--resume"));
      CHECK((files_in(disk) == before));
    }
    // What a run goes on with is still there, and said to be.
    std::ofstream filler(disk / "filler", std::ios::binary);
    const std::string piece(4096, 'x');
    while (filler.write(piece.data(), std::streamsize(piece.size())) && filler.flush()) {
    }
    require_refused(reconstruct(disk, "--voxel-size 0.05 --resume"), "the first 12 frames, and --resume goes on");
    CHECK(file_text(disk / "map.vdb") == before.at("map.vdb"));
  }
  // Room for the map and not for the mesh beside it.
  small_too.limit(size_of("map.vdb") + (64 << 10));
  for (const char* threads : {"1", "2"}) {
    require_refused(reconstruct(other, "--voxel-size 0.02 --force --threads " + std::string(threads)),
                    "the map is saved");
    CHECK(file_text(other / "map.vdb") == file_text(large / "map.vdb"));
    CHECK_FALSE(fs::exists(other / "mesh.ply"));
    fs::remove(other / "map.vdb");
  }
}

TEST_CASE("a read-only target is refused before any work, and a map on it is not changed") {
  const TemporaryDirectory folder;
  const fs::path disk = folder.path() / "disk";
  const SmallDisk small(disk);
  if (!small.good) return;
  REQUIRE(run_feltmap(reconstruct(disk, "--voxel-size 0.05")).exit_code == 0);
  const auto before = files_in(disk);
  small.make_read_only();
  const std::string map = quoted(disk / "map.vdb");
  require_refused(reconstruct(disk, "--voxel-size 0.05 --force"), "Read-only file system");
  require_refused("merge " + map + " --out " + map, "Read-only file system");
  require_refused("export " + map + " --mesh " + quoted(disk / "mesh.glb"), "Read-only file system");
  CHECK((files_in(disk) == before));
  CHECK(run_feltmap("verify " + map).exit_code == 0);
}

TEST_CASE("a target that is a device or a missing folder is refused by name") {
  const TemporaryDirectory folder;
  REQUIRE(run_feltmap(reconstruct(folder.path(), "--voxel-size 0.05")).exit_code == 0);
  const std::string map = quoted(folder.path() / "map.vdb");
  require_refused("merge " + map + " --out /dev/full", "/dev/full");
  require_refused("merge " + map + " --out " + quoted(folder.path() / "absent/map.vdb"), "absent/map.vdb");
  require_refused("export " + map + " --vdb /dev/full --force", "/dev/full");
  CHECK(fs::exists("/dev/full"));
}

TEST_CASE("an output folder that vanishes while frames are fused is an error that names it") {
  const TemporaryDirectory folder;
  const fs::path sequence = boxes_repeated(folder.path() / "sequence", 300), out = folder.path() / "out";
  const CommandResult result = run_feltmap_within(
      "", "reconstruct " + quoted(sequence) + " --out " + quoted(out) + " --quiet --checkpoint 50 --voxel-size 0.04",
      " & until [ -e " + quoted(out / "map.vdb") + " ]; do sleep 0.02; done; mv " + quoted(out) + " " +
          quoted(folder.path() / "gone") + "; wait $!");  // at once, where a recursive removal may meet a new file
  INFO(result.err);
  CHECK(result.exit_code == 4);
  CHECK_THAT(result.err, Contains(out.string()) && Contains("No such file or directory"));
}

}  // namespace felt::test
