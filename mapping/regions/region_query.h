#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "mapping/map.h"
#include "mapping/regions/view_mask.h"
#include "mapping/store/region.h"
#include "mapping/store/region_settings.h"

namespace felt {

/// Where a touch met the map.
struct Contact {
  Eigen::Vector3d point_m;    ///< as asked, world
  Eigen::Vector3d surface_m;  ///< nearest point of the surface, world
  Eigen::Vector3d normal;     ///< of the surface there, unit length, towards free space
  double distance_m = 0;      ///< between the two points
  Index3 voxel;               ///< of the surface band, nearest to the point
  int slot = -1;              ///< strongest class of the surface band within two voxels; -1 where the map has no labels
};

/// Snaps a world point to the surface. Throws TouchError with what is there instead: not finite, outside the map,
/// unobserved, free space, behind the surface; or, in a map with labels, a contact that carries none (an ignored
/// class).
Contact find_contact(const Map& map, const Eigen::Vector3d& point_m, const RegionSettings& settings);

/// The voxels that a touch at `contact` speaks for, by rule:
/// * `connected`: 26-connected from the contact over surface voxels that agree with its class (and colour, where
///   limited) and lie within the geodesic radius. The region grows only through *interior* voxels, whose neighbours in
///   the band all have normals within `normal_change_deg` of theirs, and ends with those voxels within kCollar of them
///   that lie on their planes (mapping/regions/region_surface.h). So it reaches a crease and not beyond, whatever the
///   order of growth.
/// * `sphere`: the surface band within radius_m of the contact.
/// * `instance`: the surface band of the thing that the contact belongs to, wherever it is in the map.
/// * `segment`: the contact's segment among those that the whole map is cut into (mapping/regions/map_segments.h), as
///   far as it lies within radius_m. `color_change` is then between neighbours, CIE Lab units.
/// Deterministic; blocks are examined in parallel.
Region find_region(const Map& map, const Contact& contact, const RegionSettings& settings);

/// The largest angle between neighbours of a `connected` region at this contact, degrees: `normal_change_deg`, or where
/// the surface around the contact is noisy, three times the median angle between neighbouring normals there, at
/// most 30. A crease stops every region whose limit is below half the angle by which the surface turns (docs/touch.md).
double normal_limit_deg(const Map& map, const Contact& contact, const RegionSettings& settings);

struct FittedNormal {
  Eigen::Vector3d normal;
  double sd_rad = 0;  ///< about how far it may be off
};

/// Unit normal of the surface around a contact, towards free space: of the plane that fits it within eight voxels. That
/// of a single voxel (Contact::normal) is off by several degrees on a noisy surface.
FittedNormal surrounding_normal(const Map& map, const Contact& contact, const RegionSettings& settings);

/// The surface voxels seen in the mask: those that project onto a non-zero pixel and are not hidden, by more than two
/// voxels, behind nearer surface voxels. Throws TouchError where the mask has not the camera's size, sees nothing of
/// the map, or (with a contact) where the contact is not in it.
Region find_region(const Map& map, const ViewMask& view, const RegionSettings& settings, const Contact* contact);

/// What a region is made of, and signs that it is more than one surface.
struct RegionSummary {
  size_t voxels = 0, blocks = 0;
  double area_m2 = 0;                ///< of the surface (mapping/regions/region_area.h)
  Eigen::Vector3d min_m, max_m;      ///< extent of the voxel centres, world
  std::vector<size_t> class_voxels;  ///< by slot: voxels whose strongest class it is
  size_t unlabelled_voxels = 0;
  int necks = 0;                      ///< pieces of at least 5 % that two voxels of erosion leave, less one
  double mixed_fraction = 0;          ///< labelled voxels whose strongest class is not the region's
  double open_boundary_fraction = 0;  ///< boundary voxels that end at unobserved space, of all boundary voxels
  size_t boundary_voxels = 0;         ///< region voxels next to unobserved space or to other surface
  std::vector<std::string> warnings;  ///< the indicators in words
};
RegionSummary summarize(const Map& map, const Region& region, const RegionSettings& settings);

}  // namespace felt
