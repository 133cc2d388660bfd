#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/cli/command.h"
#include "tests/cli/sequences.h"
#include "tests/support/data.h"
#include "tests/support/onnx_model.h"

namespace felt::test {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;

/// A stored scene and a network of three colours.
struct Setting {
  TemporaryDirectory folder;
  fs::path sequence = source_dir() / "data" / "scenes" / "room";
  fs::path net = write_net(folder.path(), nearest_color_net({{{.8f, .7f, .6f}, {.3f, .2f, .2f}, {.3f, .5f, .3f}}}),
                           {"bright", "dark", "green"});
  fs::path classes = folder.path() / "colours.yaml";
  fs::path out = folder.path() / "segmented";
  Setting() {
    std::ofstream(classes) << "classes:\n  - {id: 0, name: none, ignore: true}\n  - {id: 4, name: bright}\n"
                              "  - {id: 9, name: dark}\n  - {id: 2, name: green}\n";
  }
  CommandResult segment(const std::string& more) const {
    return run_feltmap("segment " + quoted(sequence) + " --net " + quoted(net) + " --classes " + quoted(classes) +
                       " --out " + quoted(out) + " --json " + more);
  }
};

}  // namespace

TEST_CASE("segment writes label images that reconstruct reads, and goes on where it was left") {
  const Setting setting;
  const CommandResult first = setting.segment("--frames 0:2");
  INFO(first.err);
  REQUIRE(first.exit_code == 0);
  CHECK(json::parse(first.out)["frames"]["written"] == 2);
  const fs::path kept = setting.out / "labels" / "000001.png";
  const cv::Mat labels = cv::imread(kept.string(), cv::IMREAD_UNCHANGED);
  REQUIRE(labels.cols == 192);
  REQUIRE(labels.rows == 144);
  CHECK(cv::countNonZero((labels == 4) | (labels == 9) | (labels == 2)) == 192 * 144);
  CHECK(cv::countNonZero(labels == 4) > 1000);
  CHECK(cv::countNonZero(labels == 9) > 1000);

  const auto written = fs::last_write_time(kept);
  const CommandResult second = setting.segment("--frames 0:4");
  REQUIRE(second.exit_code == 0);
  const json report = json::parse(second.out);
  CHECK(report["frames"]["written"] == 2);
  CHECK(report["frames"]["already_there"] == 2);
  CHECK(fs::last_write_time(kept) == written);

  const std::string settings = " --frames 0:4 --quiet --json --voxel-size 0.05";
  const CommandResult direct =
      run_feltmap("reconstruct " + quoted(setting.sequence) + " --segmenter " + quoted(setting.net) + " --classes " +
                  quoted(setting.classes) + " --out " + quoted(setting.folder.path() / "direct") + settings);
  const CommandResult by_labels = run_feltmap(
      "reconstruct " + quoted(setting.sequence) + " --labels " + quoted(setting.out / "labels") + " --classes " +
      quoted(setting.out / "classes.yaml") + " --out " + quoted(setting.folder.path() / "labels_map") + settings);
  INFO(direct.err << by_labels.err);
  REQUIRE(direct.exit_code == 0);
  REQUIRE(by_labels.exit_code == 0);
  const json a = json::parse(direct.out), b = json::parse(by_labels.out);
  CHECK(a["map_hash"] == b["map_hash"]);
  CHECK(a["time_s"]["network"] > 0);
  CHECK(b["time_s"]["network"] == 0);
  CHECK(a["bytes"]["classes"] > 0);
}

TEST_CASE("a configuration says what is made of colour, and the command line overrules it") {
  const Setting setting;
  std::ofstream(setting.folder.path() / "settings.yaml")
      << "segmenter: " << setting.net.filename().string() << "\nclasses: colours.yaml\ntop: 3\nvote: geometric\n"
      << "segment_color: 20\ncheckpoint: 2\n";
  const auto reconstruct = [&](const std::string& name, const std::string& more) {
    const CommandResult result = run_feltmap("reconstruct " + quoted(setting.sequence) +
                                             " --frames 0:3 --voxel-size 0.05 --quiet --json --out " +
                                             quoted(setting.folder.path() / name) + " " + more);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return json::parse(result.out);
  };
  const std::string config = "--config " + quoted(setting.folder.path() / "settings.yaml");
  const std::string network = "--segmenter " + quoted(setting.net) + " --classes " + quoted(setting.classes);
  const json by_file = reconstruct("file", config);
  const json by_line = reconstruct("line", network + " --top 3 --vote geometric --segment-color 20");
  CHECK(by_file["map_hash"] == by_line["map_hash"]);
  CHECK(by_file["config"]["perception"]["segment_color"] == 20);
  const json overruled = reconstruct("both", config + " --top 0 --vote none");
  CHECK(overruled["map_hash"] == reconstruct("labels", network)["map_hash"]);
  CHECK(overruled["map_hash"] != by_file["map_hash"]);
}

TEST_CASE("segment does not mix images of different settings") {
  const Setting setting;
  REQUIRE(setting.segment("--frames 0:1").exit_code == 0);
  const CommandResult other = setting.segment("--frames 0:1 --top 2");
  CHECK(other.exit_code == 3);
  CHECK(other.err.find("segment.json") != std::string::npos);
  CHECK(fs::exists(setting.out / "labels" / "000000.png"));
  const CommandResult forced = setting.segment("--frames 0:1 --top 2 --force");
  REQUIRE(forced.exit_code == 0);
  CHECK_FALSE(fs::exists(setting.out / "labels"));
  const cv::Mat probs = cv::imread((setting.out / "probs" / "000000.png").string(), cv::IMREAD_UNCHANGED);
  REQUIRE(probs.type() == CV_16U);
  REQUIRE(probs.rows == 4 * 144);
  for (int u = 0; u < probs.cols; ++u) {
    const int first = probs.at<uint16_t>(2 * 144, u), second = probs.at<uint16_t>(3 * 144, u);
    REQUIRE(first >= second);
    REQUIRE(first + second <= 65536);
  }
  std::ofstream(setting.folder.path() / "mine") << "x";
  const CommandResult foreign =
      run_feltmap("segment " + quoted(setting.sequence) + " --net " + quoted(setting.net) + " --classes " +
                  quoted(setting.classes) + " --out " + quoted(setting.folder.path()));
  CHECK(foreign.exit_code == 4);
  CHECK(fs::exists(setting.folder.path() / "mine"));
}

TEST_CASE("segment deletes no images that it reads or that no run of it wrote, and sees that labels changed") {
  const Setting setting;
  const fs::path recording = setting.folder.path() / "recording", out = setting.out;
  fs::copy(setting.sequence, recording, fs::copy_options::recursive);
  const auto voted = [&](const fs::path& into, const std::string& more = "") {
    return run_feltmap("segment " + quoted(recording) + " --vote geometric --frames 0:2 --out " + quoted(into) + " " +
                       more);
  };
  const CommandResult itself = voted(recording, "--force");
  CHECK(itself.exit_code == 3);
  CHECK_THAT(itself.err, Catch::Matchers::Contains("a folder of its own"));
  CHECK(fs::exists(recording / "labels" / "000000.png"));
  const fs::path mine = setting.folder.path() / "mine";
  fs::create_directory(mine);
  fs::copy(recording / "labels", mine / "labels");
  CHECK(voted(mine, "--force").exit_code == 4);
  CHECK(voted(mine, "--force --labels " + quoted(mine / "labels")).exit_code == 3);
  CHECK(fs::exists(mine / "labels" / "000000.png"));
  REQUIRE(voted(out).exit_code == 0);
  CHECK(voted(out, "--labels " + quoted(mine / "labels")).exit_code == 0);  // the same images, elsewhere
  fs::copy_file(recording / "labels" / "000005.png", recording / "labels" / "000000.png",
                fs::copy_options::overwrite_existing);
  const CommandResult changed = voted(out);
  CHECK(changed.exit_code == 3);
  CHECK_THAT(changed.err, Catch::Matchers::Contains("segment.json"));
  // What a run left that was stopped before its state was written is as good as nothing.
  const fs::path stopped = setting.folder.path() / "stopped";
  fs::create_directories(stopped / "labels");
  CHECK(voted(stopped).exit_code == 0);
}

TEST_CASE("a map does not depend on the number of threads that run the network") {
  const Setting setting;
  std::string hash;
  for (const int threads : {1, 3}) {
    const fs::path out = setting.folder.path() / std::to_string(threads);
    const CommandResult result =
        run_feltmap("reconstruct " + quoted(setting.sequence) + " --segmenter " + quoted(setting.net) + " --classes " +
                    quoted(setting.classes) + " --out " + quoted(out) +
                    " --top 3 --quiet --json --voxel-size 0.05 --frames 0:5 --threads " + std::to_string(threads));
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    const std::string found = json::parse(result.out)["map_hash"];
    CHECK((hash.empty() || hash == found));
    hash = found;
  }
}

TEST_CASE("options that would do nothing are refused") {
  const Setting setting;
  const auto refused = [&](const std::string& more, const std::string& expected) {
    const CommandResult result = run_feltmap(more + " --out " + quoted(setting.out));
    INFO(more << ": " << result.err);
    CHECK(result.exit_code != 0);
    CHECK(result.err.find(expected) != std::string::npos);
    CHECK_FALSE(fs::exists(setting.out));
  };
  const std::string scene = quoted(setting.sequence);
  refused("reconstruct " + scene + " --top 3", "--top: what it is for: expected --segmenter, found none");
  refused("segment " + scene + " --vote geometric --top 3", "--top: what it is for: expected --net, found none");
  refused("reconstruct " + scene + " --vote geometric --masks " + quoted(setting.folder.path()), "--masks");
  refused("segment " + scene + " --vote geometric --masks " + quoted(setting.folder.path()), "--masks");
  refused("reconstruct " + scene + " --segment-color 5", "--segment-color: what it is for: expected --vote geometric");
  // What a file says is a fault of configuration, unless the command line's --vote is why it does nothing.
  const auto configured = [&](const std::string& text, const std::string& options) {
    std::ofstream(setting.folder.path() / "settings.yaml") << text;
    return run_feltmap("reconstruct " + scene + " --frames 0:1 --voxel-size 0.1 --quiet --config " +
                       quoted(setting.folder.path() / "settings.yaml") + " --out " + quoted(setting.out) + options);
  };
  for (const std::string text :
       {"top: 3\n", "masks: .\n", "segment_color: 5\n", "vote: instances\nsegment_color: 5\n"}) {
    const CommandResult result = configured(text, "");
    INFO(text << result.err);
    CHECK(result.exit_code == 3);
    CHECK(result.err.find("settings.yaml: ") != std::string::npos);
    CHECK_FALSE(fs::exists(setting.out));
  }
  const CommandResult overruled = configured("vote: instances\nmasks: .\n", " --vote none");
  INFO(overruled.err);
  CHECK(overruled.exit_code == 0);
}

TEST_CASE("a network that cannot be used ends segment and reconstruct with one line and no output") {
  const Setting setting;
  const auto fails = [&](int code, const std::string& said) {
    for (const std::string& command : {std::string("segment "), std::string("reconstruct ")}) {
      const CommandResult result =
          run_feltmap(command + quoted(setting.sequence) + (command == "segment " ? " --net " : " --segmenter ") +
                      quoted(setting.net) + " --classes " + quoted(setting.classes) + " --frames 0:2 --out " +
                      quoted(setting.folder.path() / "none"));
      INFO(result.err);
      CHECK(result.exit_code == code);
      CHECK(result.err.find(said) != std::string::npos);
      CHECK(std::count(result.err.begin(), result.err.end(), '\n') == 1);
      CHECK_FALSE(fs::exists(setting.folder.path() / "none" / "map.vdb"));
      CHECK_FALSE(fs::exists(setting.folder.path() / "none" / "labels" / "000000.png"));
    }
  };
  const std::string whole = file_text(setting.folder.path() / "net.onnx");
  std::ofstream(setting.folder.path() / "net.onnx", std::ios::binary) << whole.substr(0, whole.size() / 2);
  fails(4, "net.onnx");
  fs::remove(setting.folder.path() / "net.onnx");
  fails(3, "net.onnx");
  TestNet net = nearest_color_net({{{.8f, .7f, .6f}, {.3f, .2f, .2f}, {.3f, .5f, .3f}}});
  net.classes[0][3] = std::nanf("");
  net.softmax = false;
  write_net(setting.folder.path(), net, {"bright", "dark", "green"});
  fails(4, "output prob, frame 0");
  write_net(setting.folder.path(), nearest_color_net({{{1, 1, 1}, {0, 0, 0}}}), {"bright", "purple"});
  fails(3, "purple");
}

}  // namespace felt::test
