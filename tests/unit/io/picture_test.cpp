#include "io/pictures/picture.h"

#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "mapping/surface/marching_cubes.h"
#include "tests/support/analytic_map.h"
#include "tests/support/data.h"

using namespace felt;

TEST_CASE("images are written as PNG files that other readers open") {
  const test::TemporaryDirectory folder;
  ColorImage image(3, 2);
  image(2, 1) = {10, 20, 30, 255};
  write_png(folder.path() / "c.png", image);
  const cv::Mat color = cv::imread((folder.path() / "c.png").string(), cv::IMREAD_UNCHANGED);
  REQUIRE((color.cols == 3 && color.rows == 2 && color.type() == CV_8UC3));
  CHECK(color.at<cv::Vec3b>(1, 2) == cv::Vec3b(30, 20, 10));

  DepthImage depth(2, 2, 0);
  depth(1, 0) = 1.2344f;
  depth(0, 1) = 70;
  depth(1, 1) = NAN;
  write_depth_png(folder.path() / "d.png", depth);
  const cv::Mat steps = cv::imread((folder.path() / "d.png").string(), cv::IMREAD_UNCHANGED);
  REQUIRE(steps.type() == CV_16UC1);
  CHECK(steps.at<uint16_t>(0, 1) == 1234);
  CHECK(steps.at<uint16_t>(1, 0) == 0);
  CHECK(steps.at<uint16_t>(1, 1) == 0);

  LabelImage labels(2, 1);
  labels(1, 0) = 40000;
  write_label_png(folder.path() / "l.png", labels);
  CHECK(cv::imread((folder.path() / "l.png").string(), cv::IMREAD_UNCHANGED).at<uint16_t>(0, 1) == 40000);
  CHECK_THROWS_AS(write_png(folder.path() / "absent" / "c.png", image), IoError);
}

TEST_CASE("the overview shows the mesh in every panel") {
  Map map(0.05, 0.2);
  test::fill_map(map, {-12, -12, -12}, {12, 12, 12}, [](const Eigen::Vector3d& p) { return p.norm() - 0.45; });
  const ColorImage picture = overview_picture(extract_mesh(map), Eigen::Vector3d::UnitZ(), 80, 60);
  REQUIRE((picture.width() == 240 && picture.height() == 120));
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 2; ++row) {
      CHECK(picture(80 * column + 40, 60 * row + 30) != Rgba8{255, 255, 255, 255});
      CHECK(picture(80 * column + 1, 60 * row + 1) == Rgba8{255, 255, 255, 255});
    }
}
