#include "io/readings/fit_priors.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "tests/support/data.h"

namespace felt {
namespace {

std::vector<ClassReadings> read(const std::string& text) {
  const test::TemporaryDirectory directory;
  const auto file = directory.path() / "readings.csv";
  std::ofstream(file) << text;
  return read_readings_csv(file);
}

}  // namespace

TEST_CASE("readings are sorted into classes and groups, whatever the order of the columns") {
  const auto classes =
      read("value,class,note,group\n0.1,ice,x,a\n# pause\n0.4,snow,,b\n0.2,ice,y,c\n\n0.3,ice,z,a\r\n");
  REQUIRE(classes.size() == 2);
  CHECK(classes[0].name == "ice");
  CHECK(classes[0].groups == GroupedReadings{{0.1, 0.3}, {0.2}});
  CHECK(classes[1].groups == GroupedReadings{{0.4}});
}

TEST_CASE("readings of a spreadsheet are read: a byte order mark and semicolons") {
  const auto classes = read(
      "\xef\xbb\xbf"
      "class;value\r\nice;0.1\r\n");
  REQUIRE(classes.size() == 1);
  CHECK(classes[0].groups == GroupedReadings{{0.1}});
}

TEST_CASE("a row that cannot be used is named by its line") {
  using Catch::Matchers::Contains;
  CHECK_THROWS_WITH(read("class,value\nice,fast\n"), Contains(":2: value"));
  CHECK_THROWS_WITH(read("class,value\nice,nan\n"), Contains(":2: value"));
  CHECK_THROWS_WITH(read("class,value\nice,0.1\nice\n"), Contains(":3: cells"));
  CHECK_THROWS_WITH(read("kind,value\nice,0.1\n"), Contains(":1: header"));
  CHECK_THROWS_WITH(read(""), Contains("content"));
  CHECK_THROWS_AS(read_readings_csv("/no/such/file"), IoError);
}

TEST_CASE("the report lists fits, correlation and the pairs that one touch cannot separate") {
  const auto report = nlohmann::json::parse(fit_priors_json(
      {{"a", {{0.1, 0.2}, {0.15, 0.3}}}, {"b", {{0.12, 0.22}, {0.2, 0.25}}}, {"c", {{5, 5.1}}}, {"d", {{1}}}}, 50));
  CHECK(report["classes"].size() == 4);
  CHECK(report["classes"][3].contains("error"));
  CHECK(report["confusion"].size() == 3);
  CHECK(report["inseparable"].size() == 1);
  CHECK(report["inseparable"][0]["classes"] == nlohmann::json({"a", "b"}));
  CHECK(report["rho"].is_number());
}

}  // namespace felt
