#include "tests/cli/recording.h"

#include <catch2/catch.hpp>

#include "tests/cli/sequences.h"
#include "tests/support/recorded_sequence.h"

namespace felt::test {

Recording::Recording(int frames) {
  write_generic(sequence, frames);
  write_text(sequence / "properties.yaml",
             "friction: {priors: {wall: {mean: 0.3, sd: 0.05}, floor: {mean: 0.5, sd: 0.05}}}\n");
}

CommandResult Recording::reconstruct(const std::string& options) const {
  return run_feltmap("reconstruct " + quoted(sequence) + " --out " + quoted(out) + " --voxel-size 0.05 --quiet " +
                     options);
}

std::string Recording::touch(const std::string& value, const std::filesystem::path& of) const {
  return "touch " + quoted(of.empty() ? map : of) + " --sequence " + quoted(sequence) +
         " --frame 0 --pixel 12,8 --region sphere --radius 0.3 --property friction --value " + value;
}

void refused(const std::string& arguments, int code, const std::string& reason) {
  const CommandResult result = run_feltmap(arguments);
  INFO(arguments << "\n" << result.err);
  CHECK(result.exit_code == code);
  CHECK_THAT(result.err, Catch::Matchers::Contains(reason));
}

}  // namespace felt::test
