#pragma once

#include <Eigen/Geometry>

#include "core/image.h"
#include "core/mesh.h"

namespace felt {

enum class Shading {
  color,   ///< the vertex colours, slightly shaded
  clay,    ///< grey, lit from the viewer's upper left: shows the geometry
  normal,  ///< the normal as red, green, blue
};

/// Parallel projection: the camera looks along +z of its frame (x right, y down); `metres_per_pixel` at the image.
struct RasterView {
  Eigen::Isometry3d T_camera_world = Eigen::Isometry3d::Identity();
  double metres_per_pixel = 0.01;
  int width = 800, height = 600;  ///< pixels; the camera's origin is in the middle of the image
};

/// Draws a mesh, back faces left out: of a room seen from outside, the walls nearest to the viewer are not in the way.
/// 2 x 2 samples a pixel; `background` where nothing is drawn. Parallel over bands of the image, the same for any
/// number of threads.
ColorImage draw_mesh(const TriangleMesh& mesh, const RasterView& view, Shading shading,
                     Rgba8 background = {255, 255, 255, 255});

/// A view of the whole mesh (without the farthest hundredth of its vertices on each side) from a direction given by
/// azimuth about `up` and elevation above the horizon, degrees; 90 degrees of elevation look straight down.
RasterView overview(const TriangleMesh& mesh, const Eigen::Vector3d& up, double azimuth_deg, double elevation_deg,
                    int width, int height);

}  // namespace felt
