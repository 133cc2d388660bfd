#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "io/images/image_encode.h"
#include "io/map_file/map_file.h"
#include "mapping/labels/class_belief.h"
#include "tests/cli/command.h"
#include "tests/cli/sequences.h"
#include "tests/support/data.h"
#include "tests/support/recorded_sequence.h"

namespace felt::test {
namespace {
namespace fs = std::filesystem;
using Catch::Matchers::Contains;
using nlohmann::json;

/// A small recording whose network takes every third column's sofa (3) for a floor (2).
struct Recording {
  TemporaryDirectory folder;
  fs::path sequence = folder.path() / "recording", predicted = folder.path() / "predicted",
           out = folder.path() / "result";
  Recording() {
    write_generic(sequence, 4);
    fs::create_directories(predicted);
    LabelImage labels = label_image();
    for (uint16_t& id : labels) id = id == 3 ? 2 : id;
    for (int i = 0; i < 4; ++i) write_bytes(predicted / (std::to_string(i) + ".png"), encode_png(labels));
  }
  CommandResult reconstruct(const std::string& options) const {
    return run_feltmap("reconstruct " + quoted(sequence) + " --out " + quoted(out) +
                       " --voxel-size 0.05 --force --json " + options);
  }
  Map map() const { return load_map(out / "map.vdb"); }
};

/// Evidence of each class over the whole map, shared evidence included.
std::vector<double> evidence(const Map& map) {
  std::vector<double> sum(size_t(map.classes.size()), 0.0), alpha(sum.size());
  for (const Block& block : map.store.blocks())
    for (int i = 0; i < kBlockVoxels; ++i) {
      class_concentration(&block, i, map.classes, alpha);
      for (size_t c = 0; c < sum.size(); ++c) sum[c] += alpha[c] - map.classes.prior(int(c));
    }
  return sum;
}

}  // namespace

TEST_CASE("a network's confusions are learned and make its labels honest") {
  const Recording recording;
  const fs::path matrix = recording.folder.path() / "confusion.yaml";
  const std::string command = "calibrate-labels " + quoted(recording.sequence) + " --labels " +
                              quoted(recording.predicted) + " --reference-labels ";
  const CommandResult learned =
      run_feltmap(command + quoted(recording.sequence / "labels") + " --json --out " + quoted(matrix));
  INFO(learned.err);
  REQUIRE(learned.exit_code == 0);
  const json report = json::parse(learned.out);
  CHECK(report.at("frames") == 4);
  CHECK(report.at("accuracy").get<double>() == Approx(2 / 3.0));
  CHECK(report.at("largest_confusions").at(0).at("true") == "sofa");
  CHECK(report.at("largest_confusions").at(0).at("predicted") == "floor");
  CHECK(report.at("held_out").at("ece").get<double>() == Approx(0).margin(1e-9));
  // Half of what it calls floor is floor: the entropy of a fair coin for two thirds of the pixels.
  CHECK(report.at("held_out").at("nll").get<double>() == Approx(2 / 3.0 * std::log(2)));

  // The reference may also be a sequence, and the file CSV.
  const fs::path csv = recording.folder.path() / "confusion.csv";
  REQUIRE(run_feltmap(command + quoted(recording.sequence) + " --quiet --out " + quoted(csv)).exit_code == 0);
  CHECK(run_feltmap(command + quoted(recording.sequence) + " --quiet --out " + quoted(csv)).exit_code == 4);

  const std::string labels = "--labels " + quoted(recording.predicted);
  REQUIRE(recording.reconstruct(labels).exit_code == 0);
  const std::vector<double> believed = evidence(recording.map());
  CHECK(believed[2] == 0);
  for (const fs::path& file : {matrix, csv}) {
    const CommandResult made = recording.reconstruct(labels + " --confusion " + quoted(file));
    INFO(made.err);
    REQUIRE(made.exit_code == 0);
    const std::vector<double> honest = evidence(recording.map());
    CHECK(honest[0] == Approx(believed[0]));
    CHECK(honest[1] == Approx(believed[1] / 2));
    CHECK(honest[2] == Approx(believed[1] / 2));
    CHECK(json::parse(made.out).at("config").at("confusion") == file.string());
  }
  write_text(csv, "x,wall,floor\nwall,1,0\nfloor,0,1\n");
  const CommandResult refused = recording.reconstruct(labels + " --confusion " + quoted(csv));
  CHECK(refused.exit_code == 3);
  CHECK_THAT(refused.err, Contains("columns: expected every class, found none for 'sofa'"));
}

TEST_CASE("what a network's confusions are worth is measured on frames that they were not learned from") {
  const Recording recording;
  // Right in even frames: only the odd ones take sofas for floor.
  for (const char* even : {"0.png", "2.png"}) write_bytes(recording.predicted / even, encode_png(label_image()));
  const CommandResult learned =
      run_feltmap("calibrate-labels " + quoted(recording.sequence) + " --labels " + quoted(recording.predicted) +
                  " --reference-labels " + quoted(recording.sequence / "labels") + " --json --out " +
                  quoted(recording.folder.path() / "confusion.yaml"));
  INFO(learned.err);
  REQUIRE(learned.exit_code == 0);
  // Of three classes with a third of the pixels each. Learned on even frames every label is sure, and a third of the
  // odd ones are wrong; learned on odd frames floor has 1/2, and in even ones it always is floor.
  const json scores = json::parse(learned.out).at("held_out");
  CHECK(scores.at("ece").get<double>() == Approx((1 / 3.0 + 1 / 6.0) / 2));
  CHECK(scores.at("brier").get<double>() == Approx((2 / 3.0 + 1 / 6.0) / 2));
  CHECK(scores.at("nll").get<double>() == Approx((-std::log(1e-12) / 3 + std::log(2) / 3) / 2));
}

TEST_CASE("label settings come from the command line or the file, are checked, and are kept with the map") {
  const Recording recording;
  const fs::path config = recording.folder.path() / "config.yaml";
  write_text(config,
             "label_band: 2\nlabel_evidence: 0.5\nlabel_cap: 3\nlabel_novelty: 0.1\nlabel_turn: 5\nclass_prior: 0.25\n"
             "ignore_classes: [sofa]\ninstances: true\nspread_rest: false\n");
  const CommandResult made = recording.reconstruct("--config " + quoted(config) + " --label-cap 4");
  INFO(made.err);
  REQUIRE(made.exit_code == 0);
  const json used = json::parse(made.out).at("config");
  CHECK(used.at("label_band_vox") == 2);
  CHECK(used.at("label_evidence") == 0.5);
  CHECK(used.at("label_cap") == 4);
  CHECK(used.at("label_novelty_m") == 0.1);
  CHECK(used.at("label_turn_deg") == 5);
  CHECK(used.at("class_prior") == 0.25);
  CHECK(used.at("ignore_classes") == json{"sofa"});
  CHECK(used.at("instances") == true);
  CHECK(used.at("spread_rest") == false);
  const Map map = recording.map();
  CHECK(json::parse(map.metadata.at("config")).at("label_cap") == 4);
  CHECK(map.classes.size() == 2);
  CHECK(map.classes.prior(0) == 0.25);

  const CommandResult bad =
      recording.reconstruct("--label-band 0 --label-evidence -1 --label-cap nan --class-prior 0 --label-turn -2");
  CHECK(bad.exit_code == 3);
  for (const char* option : {"--label-band", "--label-evidence", "--label-cap", "--class-prior", "--label-turn"})
    CHECK_THAT(bad.err, Contains(option));
  const CommandResult wide = recording.reconstruct("--label-band 4.5");
  CHECK(wide.exit_code == 3);
  CHECK_THAT(wide.err, Contains("--label-band: voxels: expected at most the truncation, 4, found 4.5"));
  const CommandResult fits = recording.reconstruct("--label-band 4.5 --truncation 5vox");
  CHECK(fits.exit_code == 0);
  CHECK(json::parse(fits.out).at("config").at("label_cap") == 50);  // what a touch can still correct
  const CommandResult unknown = recording.reconstruct("--ignore-classes person");
  CHECK(unknown.exit_code == 3);
  CHECK_THAT(unknown.err, Contains("--ignore-classes") && Contains("wall, floor, sofa"));
}

TEST_CASE("ignored classes build no surface, and unknown ids are named and counted") {
  const Recording recording;
  const json all = json::parse(recording.reconstruct("").out);
  const json fewer = json::parse(recording.reconstruct("--ignore-classes sofa,floor").out);
  CHECK(fewer.at("labels").at("ignored_pixels") == 4 * kWidth * kHeight * 2 / 3);
  CHECK(fewer.at("active_voxels").get<size_t>() < all.at("active_voxels").get<size_t>());
  CHECK(all.at("labels").at("unknown_id_pixels").empty());
  CHECK(all.at("bytes").at("classes").get<size_t>() > 0);

  write_text(recording.folder.path() / "two.yaml", "classes: [{id: 1, name: wall}, {id: 3, name: sofa}]\n");
  const json two = json::parse(recording.reconstruct("--classes " + quoted(recording.folder.path() / "two.yaml")).out);
  CHECK(two.at("labels").at("unknown_id_pixels").at("2") == 4 * kWidth * kHeight / 3);
  CHECK(two.at("labels").at("unknown_observations").get<size_t>() > 0);
  CHECK(two.at("labels").at("unknown_id_pixels").size() == 1);
}

TEST_CASE("query says which thing a point belongs to, of maps that know") {
  const Recording recording;
  const auto ask = [&](const std::string& points) {
    const CommandResult asked = run_feltmap("query " + quoted(recording.out / "map.vdb") + " --json" + points);
    INFO(asked.err);
    REQUIRE(asked.exit_code == 0);
    return json::parse(asked.out).at("points");
  };
  REQUIRE(recording.reconstruct("").exit_code == 0);
  CHECK_FALSE(ask(" --at=0,0,1.1").at(0).contains("instance"));

  fs::create_directories(recording.sequence / "instances");
  Image<uint16_t> things = label_image();  // thing 42 where the sofa is, none elsewhere
  for (uint16_t& id : things) id = id == 3 ? 42 : 0;
  for (int i = 0; i < 4; ++i)
    write_bytes(recording.sequence / "instances" / (std::to_string(i) + ".png"), encode_png(things));
  REQUIRE(recording.reconstruct("--instances").exit_code == 0);
  const Map map = recording.map();
  std::string thing, nothing;
  int votes = 0;
  for (const Block& block : map.store.blocks())
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (!(block.geometry->weight[i] > 0)) continue;
      const Index3 first = first_voxel(block.coord), in = voxel_of_offset(i);
      const std::string at = " --at=" + std::to_string(0.05 * (first.x + in.x)) + "," +
                             std::to_string(0.05 * (first.y + in.y)) + "," + std::to_string(0.05 * (first.z + in.z));
      if (block.instance == nullptr || block.instance->votes[i] == 0)
        nothing = at;
      else if (block.instance->id[i] == 42)
        thing = at, votes = block.instance->votes[i];
    }
  REQUIRE_FALSE(thing.empty());
  REQUIRE_FALSE(nothing.empty());
  const json found = ask(thing + nothing);
  CHECK(found.at(0).at("instance") == json{{"id", 42}, {"votes", votes}});
  CHECK(found.at(1).at("instance").is_null());
  const CommandResult text = run_feltmap("query " + quoted(recording.out / "map.vdb") + thing + nothing);
  CHECK_THAT(text.out, Contains("instance 42") && Contains("no instance"));
}

TEST_CASE("grids of classes open in a program that knows only OpenVDB") {
  const Recording recording;
  REQUIRE(recording.reconstruct("").exit_code == 0);
  const fs::path reader = command().parent_path().parent_path() / "tests" / "stock_vdb_reader",
                 listing = recording.folder.path() / "grids.txt";
  REQUIRE(std::system((quoted(reader) + " " + quoted(recording.out / "map.vdb") + " > " + quoted(listing)).c_str()) ==
          0);
  std::map<std::string, std::string> type;
  std::map<std::string, size_t> active;
  std::ifstream lines(listing);
  for (std::string name, value, kind, rest; lines >> name >> value >> kind >> active[name];) {
    type[name] = value;
    std::getline(lines, rest);
  }
  CHECK(type.at("label") == "int32");
  for (const char* name : {"label_prob", "entropy", "evidence_total", "evidence/wall", "evidence/floor"})
    CHECK(type.at(name) == "float");
  CHECK(active.at("label") > 50);
  CHECK(active.at("label") == active.at("evidence_total"));
  CHECK(active.at("label_prob") == active.at("entropy"));
  CHECK(active.at("evidence/wall") < active.at("label"));
}

TEST_CASE("a class table that cannot be used ends with every fault and exit code 3") {
  const Recording recording;
  const fs::path table = recording.folder.path() / "t.yaml";
  write_text(table,
             "classes:\n  - {id: 1, name: wall}\n  - {id: 1, name: floor, prior: 0}\n  - {id: 2, name: wall}\n  - {id: "
             "70000, name: high}\n  - {id: 3}\n");
  const CommandResult refused = recording.reconstruct("--classes " + quoted(table));
  CHECK(refused.exit_code == 3);
  for (const char* part : {"id 1", "name 'wall'", "t.yaml:3: prior", "t.yaml:5: id", "t.yaml:6: name"})
    CHECK_THAT(refused.err, Contains(part));
  const fs::path csv = recording.folder.path() / "t.csv";
  write_text(csv, "id,name,r,g,b\n1,wall,0,0,255\n2,floor,0,256,0\n");
  const CommandResult color = recording.reconstruct("--classes " + quoted(csv));
  CHECK(color.exit_code == 3);
  CHECK_THAT(color.err, Contains("t.csv:3: color: expected r, g, b from 0 to 255, found '0, 256, 0'"));
}

TEST_CASE("labels that no table knows, and instances that no frame has, are said to be lost, also quietly") {
  const Recording recording;
  std::ofstream(recording.folder.path() / "other.yaml") << "classes: [{id: 40, name: lamp}, {id: 41, name: door}]\n";
  const CommandResult result =
      recording.reconstruct("--quiet --classes " + quoted(recording.folder.path() / "other.yaml"));
  REQUIRE(result.exit_code == 0);
  CHECK_THAT(result.err, Contains("labels that the class table does not know") && Contains("no voxel has a label"));
}

}  // namespace felt::test
