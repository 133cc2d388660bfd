#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/image.h"

namespace felt {

/// A scan of a turning range sensor becomes four square pinhole views of 90 degrees, so that the integrator of depth
/// images fuses it as it is.
inline constexpr int kScanFaces = 4;

/// Points of a KITTI Velodyne scan: little-endian float32 x, y, z, intensity; sensor frame (x forward, y left, z up),
/// metres. Points that are not finite are left out. Throws ImageError ("truncated") where the bytes are no whole
/// number of points.
std::vector<Eigen::Vector3f> decode_scan(std::span<const uint8_t> bytes, const std::string& where);

/// Camera of every face: a pixel is about as wide as the sensor's step.
PinholeCamera scan_face_camera();

/// Pose of a face's camera (OpenCV axes) in the sensor's frame; faces look forward, left, backward and right.
Eigen::Isometry3d T_scan_face(int face);

/// Depth image of a face, seen by a camera of 90 degrees. Points are put into a spherical image of 64 rows, the nearest
/// one of a cell counting; a pixel of the face takes the range between the rows above and below its ray (linear in
/// inverse range, exact for planes seen across one column) where both lie within two rows and differ by less than a
/// fifth: gaps between surfaces stay open.
DepthImage depth_of_scan(const std::vector<Eigen::Vector3f>& points, int face,
                         const PinholeCamera& camera = scan_face_camera());

}  // namespace felt
