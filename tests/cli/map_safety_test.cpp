// Nothing that a map holds is lost to a name, a neighbour or another command.
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <future>
#include <nlohmann/json.hpp>

#include "io/files/file_lock.h"
#include "io/images/image_encode.h"
#include "io/map_file/map_file.h"
#include "mapping/touch/touch_update.h"
#include "tests/cli/command.h"
#include "tests/cli/recording.h"
#include "tests/cli/sequences.h"
#include "tests/support/data.h"
#include "tests/support/random_map.h"
#include "tests/support/recorded_sequence.h"
#include "tests/support/waiting.h"

namespace felt::test {
namespace fs = std::filesystem;
using Catch::Matchers::Contains;

TEST_CASE("files of people beside a map stay, also those that are called parts") {
  const Recording recording;
  fs::create_directories(recording.out);
  for (const char* name : {"map.vdb", "map.part-1.vdb", "map.part-kitchen.vdb", "map.part-1-b.vdb", "map.part-7-1.vdb"})
    write_text(recording.out / name, "mine");
  CHECK(recording.reconstruct().exit_code == 4);
  CHECK(fs::exists(recording.out / "map.part-7-1.vdb"));  // nothing is tidied where nothing is begun
  REQUIRE(recording.reconstruct("--force").exit_code == 0);
  for (const char* name : {"map.part-1.vdb", "map.part-kitchen.vdb", "map.part-1-b.vdb"})
    CHECK(file_text(recording.out / name) == "mine");
  CHECK_FALSE(fs::exists(recording.out / "map.part-7-1.vdb"));
}

TEST_CASE("a map that is named by a link is as safe as by its own name") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const std::string before = file_text(recording.map);
  fs::create_directory(recording.folder.path() / "links");
  const fs::path link = recording.folder.path() / "links" / "latest.vdb";
  fs::create_symlink("../result/map.vdb", link);
  {
    const FileLock at_work(recording.out, FileLock::Kind::exclusive, 0);
    refused(recording.touch("0.4", link), 4, "another feltmap");
  }
  CHECK(file_text(recording.map) == before);
  REQUIRE(run_feltmap(recording.touch("0.4", link)).exit_code == 0);
  CHECK(fs::is_symlink(link));
  CHECK(load_map(recording.map).touches.touches.size() == 1);
  // And where there is nothing yet at the other end.
  const fs::path ahead = recording.folder.path() / "links" / "ahead.vdb";
  fs::create_symlink("../result/later.vdb", ahead);
  REQUIRE(run_feltmap("merge " + quoted(recording.map) + " --out " + quoted(ahead)).exit_code == 0);
  CHECK(fs::is_symlink(ahead));
  CHECK(load_map(recording.out / "later.vdb").touches.touches.size() == 1);
}

TEST_CASE("a touch by the frame of another recording is said to be one") {
  const Recording recording, other(9);
  REQUIRE(recording.reconstruct().exit_code == 0);
  CHECK_THAT(run_feltmap(recording.touch()).err, !Contains("other recordings"));
  write_text(other.sequence / "poses.txt", file_text(recording.sequence / "poses.txt"));
  const CommandResult result =
      run_feltmap("touch " + quoted(recording.map) + " --sequence " + quoted(other.sequence) +
                  " --frame 0 --pixel 12,8 --region sphere --radius 0.3 --property friction --value 0.4 --stamp 1");
  CHECK(result.exit_code == 2);  // a frame has a time of its own
  const CommandResult there =
      run_feltmap("touch " + quoted(recording.map) + " --sequence " + quoted(other.sequence) +
                  " --frame 1 --pixel 12,8 --region sphere --radius 0.3 --property friction --value 0.4");
  INFO(there.err);
  CHECK(there.exit_code == 0);
  CHECK_THAT(there.err, Contains("was made of other recordings"));
}

TEST_CASE("commands that change one map wait for each other, and none writes into a folder at work") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const CommandResult four = run_feltmap_within("for i in 1 2 3 4; do ", recording.touch("0.4$i"), " & done; wait");
  INFO(four.err);
  CHECK(four.exit_code == 0);
  CHECK(load_map(recording.map).touches.touches.size() == 4);
  const std::string before = file_text(recording.map);
  {
    const FileLock at_work(recording.out, FileLock::Kind::exclusive, 0);
    refused(recording.touch(), 4, "another feltmap");
    refused("merge " + quoted(recording.map) + " --out " + quoted(recording.map), 4, "another feltmap");
    refused("export " + quoted(recording.map) + " --vdb " + quoted(recording.out / "copy.vdb"), 4, "another feltmap");
    CHECK(recording.reconstruct("--force").exit_code == 4);
  }
  CHECK(file_text(recording.map) == before);
}

TEST_CASE("a touched copy and a merged map replace only what they hold") {
  const Recording recording, other(2);
  REQUIRE(recording.reconstruct().exit_code == 0);
  write_bytes(other.sequence / "depth" / "0.png", encode_png(Image<uint16_t>(kWidth, kHeight, 3000)));
  REQUIRE(other.reconstruct().exit_code == 0);
  const fs::path notes = recording.folder.path() / "notes.txt", finer = recording.folder.path() / "finer";
  write_text(notes, "mine");
  const std::string foreign = file_text(other.map);
  refused(recording.touch() + " --out " + quoted(notes), 4, "--force");
  refused(recording.touch() + " --out " + quoted(other.map), 4, "frames");
  CHECK(file_text(notes) == "mine");
  CHECK(file_text(other.map) == foreign);
  CHECK(run_feltmap(recording.touch() + " --force --out " + quoted(notes)).exit_code == 0);

  // The same frames in finer voxels, and a touch that is undone in the new map.
  REQUIRE(run_feltmap("reconstruct " + quoted(recording.sequence) + " --voxel-size 0.02 --quiet --out " + quoted(finer))
              .exit_code == 0);
  const std::string merge = "merge " + quoted(recording.map) + " --out ";
  refused(merge + quoted(finer / "map.vdb"), 4, "voxels");
  const fs::path touched = recording.folder.path() / "touched.vdb";
  REQUIRE(run_feltmap(recording.touch() + " --out " + quoted(touched)).exit_code == 0);
  refused(merge + quoted(touched), 4, "1 touches that the new one does not hold");
  const fs::path undone = recording.folder.path() / "undone.vdb";
  const std::string id = id_text(load_map(touched).touches.touches.at(0).id);
  REQUIRE(run_feltmap("touch " + quoted(touched) + " --undo " + id + " --out " + quoted(undone)).exit_code == 0);
  refused("merge " + quoted(undone) + " --out " + quoted(touched), 4,
          "a map where 1 touches count that are undone in the new one");
}

TEST_CASE("a map does not grow in place under a cap that takes away what it holds") {
  const TemporaryDirectory folder;
  const auto part = [&](const char* frames) {
    const fs::path out = folder.path() / frames;
    REQUIRE(run_feltmap("reconstruct " + quoted(boxes()) + " --voxel-size 0.1 --max-weight 2 --label-cap 2 --quiet " +
                        "--frames " + frames + " --out " + quoted(out))
                .exit_code == 0);
    return quoted(out / "map.vdb") + " ";
  };
  const fs::path all = folder.path() / "all.vdb";
  const std::string uncapped = " --max-weight 255 --label-cap 0", last = part("8:12"),
                    grow = "merge " + quoted(all) + " " + last + "--out " + quoted(all);
  REQUIRE(run_feltmap("merge " + part("0:4") + part("4:8") + "--out " + quoted(all) + uncapped).exit_code == 0);
  const std::string before = file_text(all);
  const std::string reason =
      "voxels of more weight or class evidence than in the new one (--max-weight and --label-cap";
  refused(grow, 4, reason);
  refused(grow + " --max-weight 255", 4, reason);
  refused(grow + " --label-cap 0", 4, reason);
  CHECK(file_text(all) == before);
  CHECK(run_feltmap(grow + uncapped).exit_code == 0);
}

TEST_CASE("an output that names a folder is refused at once, however the folder is spelled") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const fs::path folder = recording.folder.path() / "folder", link = recording.folder.path() / "link";
  fs::create_directory(folder);
  fs::create_directory_symlink(folder, link);
  for (const fs::path& out : {folder, folder / "", folder / ".", fs::path("."), fs::path("/"), link}) {
    const std::string reason = "expected a regular file or a new name, found a folder";
    refused("merge " + quoted(recording.map) + " --out " + quoted(out), 4, reason);
    refused(recording.touch() + " --out " + quoted(out), 4, reason);
    refused("export " + quoted(recording.map) + " --force --vdb " + quoted(out), 4, reason);
  }
  refused("merge " + quoted(recording.map) + " --out " + quoted(recording.folder.path() / "new" / ""), 4, "folder");
  fs::create_symlink("ring", recording.folder.path() / "ring");
  refused("merge " + quoted(recording.map) + " --out " + quoted(recording.folder.path() / "ring"), 4, "symbolic links");
  CHECK(fs::is_empty(folder));
}

TEST_CASE("the mesh of a region replaces neither the map nor, unless told to, another file") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  // A map may be called anything.
  const fs::path map = recording.out / "map.ply", link = recording.out / "link.ply",
                 mesh = recording.out / "region.ply";
  fs::rename(recording.map, map);
  fs::create_symlink(map, link);
  const std::string before = file_text(map);
  const CommandResult touch = run_feltmap(recording.touch("0.4", map) + " --dry-run --json");
  REQUIRE(touch.exit_code == 0);
  const nlohmann::json at = nlohmann::json::parse(touch.out)["touches"][0]["contact"]["surface_m"];
  const auto region = [&](const fs::path& to) {
    return "region " + quoted(map) + " --at=" + at[0].dump() + "," + at[1].dump() + "," + at[2].dump() +
           " --region sphere --radius 0.3 --mesh " + quoted(to);
  };
  for (const fs::path& same : {map, link}) {
    refused(region(same), 3, "--mesh: file: expected another one than the map that is read");
    refused(region(same) + " --force", 3, "--mesh");
  }
  CHECK(file_text(map) == before);
  REQUIRE(run_feltmap(region(mesh)).exit_code == 0);
  write_text(mesh, "mine");
  refused(region(mesh), 4, "expected no file there, or --force");
  CHECK(file_text(mesh) == "mine");
  CHECK(run_feltmap(region(mesh) + " --force").exit_code == 0);
  CHECK(file_text(mesh) != "mine");
  refused(region(recording.out / "region.stl"), 3, ".stl");
}

TEST_CASE("a map of the same frames with other labels is not replaced") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const fs::path labels = recording.folder.path() / "labels", out = recording.folder.path() / "other";
  fs::create_directory(labels);
  for (int i = 0; i < 4; ++i)
    write_bytes(labels / (std::to_string(i) + ".png"), encode_png(Image<uint16_t>(kWidth, kHeight, 3)));
  REQUIRE(run_feltmap("reconstruct " + quoted(recording.sequence) + " --labels " + quoted(labels) + " --out " +
                      quoted(out) + " --voxel-size 0.05 --quiet")
              .exit_code == 0);
  const std::string before = file_text(recording.map);
  refused("merge " + quoted(out / "map.vdb") + " --out " + quoted(recording.map), 4, "class evidence");
  refused(recording.touch("0.4", out / "map.vdb") + " --out " + quoted(recording.map), 4, "class evidence");
  CHECK(file_text(recording.map) == before);
  CHECK(run_feltmap("merge " + quoted(recording.map) + " --out " + quoted(recording.map)).exit_code == 0);
}

TEST_CASE("a part that was cut out of a map does not replace it, although it knows the same frames") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const fs::path part = recording.folder.path() / "part.vdb";
  REQUIRE(
      run_feltmap("export " + quoted(recording.map) + " --vdb " + quoted(part) + " --box -3,-3,0,0.4,3,5").exit_code ==
      0);
  const std::string whole = file_text(recording.map), merge = "merge " + quoted(part) + " --out ";
  const size_t lost = active_voxel_count(load_map(recording.map)) - active_voxel_count(load_map(part));
  REQUIRE(lost > 0);
  const std::string reason = "a map with " + std::to_string(lost) + " observed voxels that the new one does not hold";
  refused(merge + quoted(recording.map), 4, reason);
  refused(recording.touch("0.4", part) + " --out " + quoted(recording.map), 4, reason);
  CHECK(file_text(recording.map) == whole);
  CHECK(run_feltmap(merge + quoted(part)).exit_code == 0);
  CHECK(run_feltmap(merge + quoted(recording.map) + " --force").exit_code == 0);
}

TEST_CASE("a touched copy that replaces another says which touches are gone") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const fs::path copy = recording.folder.path() / "copy.vdb";
  const std::string first = recording.touch("0.4") + " --out " + quoted(copy);
  const auto warns = [](const std::string& arguments) {
    const CommandResult result = run_feltmap(arguments);
    INFO(arguments << "\n" << result.err);
    CHECK(result.exit_code == 0);
    return result.err.find("not in the map that replaces it") != std::string::npos;
  };
  CHECK_FALSE(warns(first));
  CHECK_FALSE(warns(first));  // the same touch again
  const std::string id = id_text(load_map(copy).touches.touches.at(0).id);
  CHECK_FALSE(warns("touch " + quoted(copy) + " --out " + quoted(copy) + " --undo " + id));
  CHECK_FALSE(warns("touch " + quoted(copy) + " --out " + quoted(copy) + " --redo " + id));
  CHECK(warns(recording.touch("0.5") + " --out " + quoted(copy)));
  CHECK(load_map(copy).touches.touches.size() == 1);
}

TEST_CASE("a map that was made read-only is replaced only with --force, also by the superuser") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  fs::permissions(recording.map, fs::perms::owner_read | fs::perms::group_read | fs::perms::others_read);
  const std::string before = file_text(recording.map);
  const std::string commands[] = {
      recording.touch(), "merge " + quoted(recording.map) + " --out " + quoted(recording.map),
      "reconstruct " + quoted(recording.sequence) + " --out " + quoted(recording.out) + " --voxel-size 0.05 --resume"};
  for (const std::string& arguments : commands)
    refused(arguments, 4, "expected a file that may be written, or --force, found one that was made read-only");
  CHECK(file_text(recording.map) == before);
  CHECK(run_feltmap(recording.touch() + " --force").exit_code == 0);
  CHECK(file_text(recording.map) != before);
}

TEST_CASE("a command reads the map that it replaces when nobody else is at work on it") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  const std::string map = quoted(recording.map);
  for (const std::string& arguments :
       {"merge " + map + " --out " + map, "export " + map + " --vdb " + map + " --compact --force"}) {
    std::future<CommandResult> result;
    REQUIRE(run_feltmap(recording.touch()).exit_code == 0);
    {
      const FileLock at_work(recording.map, FileLock::Kind::exclusive, 0);
      result = std::async(std::launch::async, [&] { return run_feltmap(arguments); });
      CHECK(wait_until_feltmap_has_open(recording.out));
      Map changed = load_map(recording.map);
      undo_touch(changed, changed.touches.touches.back().id);
      save_map(changed, recording.map);
    }
    const CommandResult done = result.get();
    INFO(arguments << "\n" << done.err);
    CHECK(done.exit_code == 0);
    CHECK_FALSE(load_map(recording.map).touches.any_active());
  }
}

TEST_CASE("a run does not replace what came into its folder while it waited for another") {
  const Recording recording;
  fs::create_directories(recording.out);
  std::future<CommandResult> result;
  {
    const FileLock at_work(recording.out, FileLock::Kind::exclusive, 0);
    result = std::async(std::launch::async, [&] { return recording.reconstruct(); });
    CHECK(wait_until_feltmap_has_open(recording.out));
    write_text(recording.map, "mine");
  }
  CHECK(result.get().exit_code == 4);
  CHECK(file_text(recording.map) == "mine");
}

TEST_CASE("maps whose properties or votes differ are no equal maps") {
  const TemporaryDirectory folder;
  const std::string a = (folder.path() / "a.vdb").string(), b = (folder.path() / "b.vdb").string();
  Map map = random_map({.seed = 3, .blocks = 4, .classes = 2, .instances = true});
  save_map(map, a);
  const PropertyTable before = map.properties;
  Property friction;
  friction.name = "friction";
  friction.priors["class 0"] = {0.3, 0.1, 4};
  map.properties = PropertyTable({friction});
  save_map(map, b);
  const CommandResult tables = run_feltmap("diff " + a + " " + b);
  CHECK(tables.exit_code == 1);
  CHECK_THAT(tables.out, Contains("property tables"));
  map.properties = before;
  for (uint32_t i = 0; i < map.store.size(); ++i)
    if (InstancePlanes* planes = map.store[i].instance)
      for (int v = 0; v < kBlockVoxels; ++v) planes->votes[v] = uint16_t(planes->id[v] != 0 ? planes->votes[v] + 1 : 0);
  save_map(map, b);
  CHECK(run_feltmap("diff --tol 0 " + a + " " + b).exit_code == 1);
  CHECK(run_feltmap("diff --tol 1 " + a + " " + b).exit_code == 0);
  // Ids are names: no tolerance makes two of them equal.
  for (uint32_t i = 0; i < map.store.size(); ++i)
    if (InstancePlanes* planes = map.store[i].instance)
      for (int v = 0; v < kBlockVoxels; ++v) planes->id[v] = uint16_t(planes->id[v] != 0 ? planes->id[v] + 1 : 0);
  save_map(map, b);
  CHECK(run_feltmap("diff --tol 1000 " + a + " " + b).exit_code == 1);
}

TEST_CASE("what cannot be printed is an error, and a pipe is no map") {
  const Recording recording;
  REQUIRE(recording.reconstruct().exit_code == 0);
  CHECK(run_feltmap_within("", "info --json " + quoted(recording.map), " > /dev/full").exit_code == 4);
  const fs::path pipe = recording.folder.path() / "pipe";
  REQUIRE(mkfifo(pipe.c_str(), 0600) == 0);
  refused("verify " + quoted(pipe), 4, "regular file");
  // A map is one by its content.
  fs::copy(recording.map, recording.folder.path() / "map.backup");
  CHECK(run_feltmap("info " + quoted(recording.folder.path() / "map.backup")).exit_code == 0);
}

}  // namespace felt::test
