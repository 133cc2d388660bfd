#include "tests/cli/sequences.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <vector>

#include "tests/cli/command.h"
#include "tests/support/data.h"

namespace felt::test {
namespace fs = std::filesystem;

std::string quoted(const fs::path& path) { return "'" + path.string() + "'"; }

const fs::path& boxes() {
  static const TemporaryDirectory directory;
  static const fs::path sequence = directory.path() / "boxes";
  if (!fs::exists(sequence)) {
    const CommandResult made = run_feltmap("simulate boxes --out " + quoted(sequence) +
                                           " --frames 12 --width 160 --height 120 --no-mesh --quiet");
    INFO(made.err);
    REQUIRE(made.exit_code == 0);
  }
  return sequence;
}

fs::path repeated(const fs::path& recording, const fs::path& folder, int rounds) {
  std::ifstream recorded(recording / "poses.txt");
  std::vector<std::string> poses;
  for (std::string line; std::getline(recorded, line);)
    if (!line.empty() && line[0] != '#') poses.push_back(line.substr(line.find(' ')));
  const int frames = int(poses.size());
  REQUIRE(frames > 0);
  fs::create_directories(folder);
  for (const char* name : {"sequence.yaml", "classes.yaml", "properties.yaml"})
    if (fs::exists(recording / name)) fs::copy(recording / name, folder / name);
  for (const char* channel : {"color", "depth", "labels"}) {
    if (!fs::exists(recording / channel)) continue;
    fs::create_directory(folder / channel);
    for (const auto& image : fs::directory_iterator(recording / channel)) {
      const int number = std::stoi(image.path().stem().string());
      for (int round = 0; round < rounds; ++round)
        fs::create_symlink(
            image.path(),
            folder / channel / (std::to_string(number + frames * round) + image.path().extension().string()));
    }
  }
  std::ofstream all(folder / "poses.txt");
  for (int i = 0; i < frames * rounds; ++i) all << i << poses[size_t(i % frames)] << '\n';
  return folder;
}

fs::path boxes_repeated(const fs::path& folder, int rounds) { return repeated(boxes(), folder, rounds); }

}  // namespace felt::test
