#include <algorithm>
#include <catch2/catch.hpp>

#include "tests/cli/command.h"

namespace felt::test {

TEST_CASE("the version is printed on stdout") {
  const CommandResult result = run_feltmap("--version");
  CHECK(result.exit_code == 0);
  CHECK_THAT(result.out, Catch::Matchers::Matches("feltmap [0-9]+\\.[0-9]+\\.[0-9]+ \\(SIMD: [a-z0-9]+\\)\n"));
  CHECK(result.err.empty());
}

TEST_CASE("the SIMD target can be chosen by the environment, and a wrong one is refused") {
  REQUIRE(setenv("FELTMAP_SIMD", "scalar", 1) == 0);
  CHECK_THAT(run_feltmap("--version").out, Catch::Matchers::EndsWith("(SIMD: scalar)\n"));
  REQUIRE(setenv("FELTMAP_SIMD", "mmx", 1) == 0);
  const CommandResult wrong = run_feltmap("--version");
  CHECK(wrong.exit_code == 3);
  CHECK_THAT(wrong.err, Catch::Matchers::Contains("FELTMAP_SIMD") && Catch::Matchers::Contains("mmx"));
  REQUIRE(unsetenv("FELTMAP_SIMD") == 0);
}

TEST_CASE("a command line that makes no sense exits with 2 and one line on stderr") {
  for (const char* arguments : {"", "no-such-command", "--no-such-option"}) {
    INFO("feltmap " << arguments);
    const CommandResult result = run_feltmap(arguments);
    CHECK(result.exit_code == 2);
    CHECK(result.out.empty());
    CHECK_THAT(result.err, Catch::Matchers::StartsWith("feltmap: error: "));
    CHECK(std::count(result.err.begin(), result.err.end(), '\n') == 1);
  }
}

TEST_CASE("an unknown command is named beside those there are") {
  const CommandResult result = run_feltmap("frobnicate --json");
  CHECK(result.exit_code == 2);
  CHECK_THAT(result.err, Catch::Matchers::StartsWith("feltmap: error: 'frobnicate': expected one of reconstruct, ") &&
                             Catch::Matchers::EndsWith(" (see feltmap --help)\n"));
  CHECK_THAT(result.err, Catch::Matchers::Contains("friction"));
}

TEST_CASE("help that cannot be written is an error of output") {
  const CommandResult result = run_feltmap_within("", "--help", " >/dev/full");
  CHECK(result.exit_code == 4);
  CHECK_THAT(result.err, Catch::Matchers::Contains("standard output: cannot be written"));
}

TEST_CASE("a seed below zero and depths in the wrong order are refused") {
  CHECK(run_feltmap("simulate room --out x --seed=-1").exit_code == 2);
  const CommandResult result = run_feltmap("evaluate x.vdb --reference-mesh y.ply --min-depth 5 --max-depth 4");
  CHECK(result.exit_code == 3);
  CHECK_THAT(result.err, Catch::Matchers::Contains("expected a number above --min-depth, 5.0, found 4.0"));
}

TEST_CASE("an option that a shell left without a value is named, and does not take the next word") {
  const CommandResult result = run_feltmap("reconstruct x --out= --force");
  CHECK(result.exit_code == 2);
  CHECK_THAT(result.err, Catch::Matchers::Contains("'--out=': expected a value"));
}

}  // namespace felt::test
