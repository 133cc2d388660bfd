// Which limit between normals finds whole surfaces on noisy maps without leaking over creases (docs/touch.md): regions
// without class limits by central differences, by the plane through 27 or 125 voxels, and by the region query, in
// simulated rooms where the touched face is known, and in recorded sequences.
//   bench_region_noise [rooms | recorded]
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <unordered_map>

#include "bench/support/bench.h"
#include "io/simulation/render_sequence.h"
#include "io/simulation/scene.h"
#include "io/simulation/scene_library.h"
#include "io/simulation/touches.h"
#include "io/simulation/trajectory.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/regions/region_query.h"
#include "mapping/regions/region_surface.h"

namespace {
using namespace felt;

enum Normals { central, voxels27, voxels125 };
constexpr const char* kNormals[] = {"central differences", "27 voxels", "125 voxels"};

struct Rule {
  Normals normals;
  double limit_deg;
};
constexpr Rule kRules[] = {{central, 20}, {central, 45}, {voxels27, 20}, {voxels27, 30}, {voxels125, 20}};

/// The surface band of a map with its 26-neighbours and normals.
struct Surface {
  std::vector<Index3> voxel;
  std::unordered_map<Index3, int> number;
  std::vector<std::array<int, 26>> near;  ///< -1: not of the band
  std::vector<Eigen::Vector3f> normal[3];
};

float tsdf_at(const Map& map, const Index3& v) {
  const Block* block = map.store.get(block_of_voxel(v));
  const int i = offset_in_block(v);
  return block != nullptr && block->geometry->weight[i] >= 1 ? block->geometry->tsdf[i]
                                                             : std::numeric_limits<float>::quiet_NaN();
}

/// Mean slope along each axis over the lines that pass within `reach` voxels.
Eigen::Vector3f mean_slopes(const Map& map, const Index3& v, int reach) {
  Eigen::Vector3f gradient = Eigen::Vector3f::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    float sum = 0;
    int count = 0;
    for (int a = -reach; a <= reach; ++a)
      for (int b = -reach; b <= reach; ++b) {
        const auto at = [&](int step) {
          int d[3];
          d[axis] = step, d[(axis + 1) % 3] = a, d[(axis + 2) % 3] = b;
          return tsdf_at(map, {v.x + d[0], v.y + d[1], v.z + d[2]});
        };
        const float minus = at(-1), here = at(0), plus = at(1);
        float slope = !std::isnan(minus) && !std::isnan(plus) ? 0.5f * (plus - minus)
                      : std::isnan(minus)                     ? plus - here
                                                              : here - minus;
        if (const float far = 2 * (at(2) - at(-2)) + plus - minus; reach == 2 && !std::isnan(far)) slope = far / 10;
        if (!std::isnan(slope)) sum += slope, ++count;
      }
    if (count > 0) gradient[axis] = sum / float(count);
  }
  const float length = gradient.norm();
  return length > 0 ? Eigen::Vector3f(gradient / length) : Eigen::Vector3f(Eigen::Vector3f::Zero());
}

Surface surface_of(const Map& map) {
  Surface s;
  for (const uint32_t n : map.store.sorted()) {
    const Index3 f = first_voxel(map.store[n].coord);
    for_each_bit(surface_band(map.store[n], float(map.voxel_size_m), 1), [&](int i) {
      const Index3 o = voxel_of_offset(i), v{f.x + o.x, f.y + o.y, f.z + o.z};
      s.number[v] = int(s.voxel.size());
      s.voxel.push_back(v);
    });
  }
  for (const Index3& v : s.voxel) {
    std::array<int, 26>& near = s.near.emplace_back();
    for (int n = 0, i = 0; n < 27; ++n) {
      if (n == 13) continue;
      const auto found = s.number.find({v.x + n / 9 - 1, v.y + n / 3 % 3 - 1, v.z + n % 3 - 1});
      near[size_t(i++)] = found == s.number.end() ? -1 : found->second;
    }
    s.normal[central].push_back(mean_slopes(map, v, 0));
    s.normal[voxels27].push_back(surface_normal(map, v, 1));
    s.normal[voxels125].push_back(mean_slopes(map, v, 2));
  }
  return s;
}

/// Voxels reached from `seed` through those for which `through` holds; every voxel beside one of them joins.
template <typename Through>
std::vector<char> flooded(const Surface& s, int seed, const Through& through) {
  std::vector<char> joined(s.voxel.size(), 0), seen(s.voxel.size(), 0);
  std::vector<int> open{seed};
  joined[size_t(seed)] = seen[size_t(seed)] = 1;
  while (!open.empty()) {
    const int v = open.back();
    open.pop_back();
    if (v != seed && !through(v)) continue;
    for (const int u : s.near[size_t(v)])
      if (u >= 0) {
        joined[size_t(u)] = 1;
        if (!seen[size_t(u)]) seen[size_t(u)] = 1, open.push_back(u);
      }
  }
  return joined;
}

std::vector<char> region_by(const Surface& s, const Rule& rule, int seed) {
  const std::vector<Eigen::Vector3f>& normal = s.normal[rule.normals];
  const float least = float(std::cos(rule.limit_deg * std::numbers::pi / 180));
  return flooded(s, seed, [&](int v) {
    return std::all_of(s.near[size_t(v)].begin(), s.near[size_t(v)].end(),
                       [&](int u) { return u < 0 || normal[size_t(v)].dot(normal[size_t(u)]) >= least; });
  });
}

std::vector<char> region_by_query(const Map& map, const Surface& s, const Contact& contact) {
  const Region region = find_region(map, contact, {});
  std::vector<char> joined(s.voxel.size());
  for (size_t v = 0; v < joined.size(); ++v) joined[v] = region.contains(s.voxel[v]);
  return joined;
}

double quantile_of(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[size_t(q * double(values.size() - 1))];
}

struct Place {
  Contact contact;
  int seed = 0;
};

/// Runs every rule at every place; `score(place, region)` keeps the figures of column `rule`.
template <typename Score>
void compare(const Map& map, const Surface& s, const std::vector<Place>& places, const Score& score) {
  for (size_t p = 0; p < places.size(); ++p) {
    for (size_t r = 0; r < std::size(kRules); ++r) score(p, r, region_by(s, kRules[r], places[p].seed));
    score(p, std::size(kRules), region_by_query(map, s, places[p].contact));
  }
}

constexpr size_t kColumns = std::size(kRules) + 1;

std::string rule_text(size_t column) {
  if (column == std::size(kRules)) return "27 voxels, 20 to 30 by noise (the query)";
  return std::string(kNormals[kRules[column].normals]) + ", " + std::to_string(int(kRules[column].limit_deg));
}

void rooms(const std::string& name, int frames, bool noisy) {
  constexpr double kVoxel = 0.03;
  std::vector<double> whole[kColumns], noise_deg;
  int leaks[kColumns] = {}, large[kColumns] = {};
  for (int room = 1; room <= 4; ++room) {
    const Scene scene = make_scene("room" + std::to_string(room));
    const Trajectory trajectory = standard_trajectory(scene, frames);
    const PinholeCamera camera = simulated_camera(320, 240);
    RenderOptions options;
    options.with_color = false;
    if (noisy) options.noise = DepthNoise{};
    Map map(kVoxel, 4 * kVoxel);
    IntegrationScratch scratch;
    for (size_t i = 0; i < trajectory.size(); ++i)
      integrate(map, render_frame(scene, camera, trajectory[i], int64_t(i), options), {}, scratch);
    const Surface s = surface_of(map);
    TouchOptions touch_options;
    touch_options.count = 12;
    std::vector<Place> places;
    std::vector<Eigen::Vector3d> normals, points;
    std::vector<const Primitive*> things;
    for (const SimulatedTouch& t :
         simulate_touches(scene, trajectory, camera, simulated_properties()[0], touch_options)) {
      const Primitive& thing = scene.primitives[size_t(nearest_surface(scene, t.position_m).primitive)];
      if (thing.shape != ShapeKind::plane && thing.shape != ShapeKind::box) continue;
      try {
        const Contact contact = find_contact(map, t.position_m, {});
        places.push_back({contact, s.number.at(contact.voxel)});
      } catch (const TouchError&) {
        continue;
      }
      SurfaceRule band;
      band.band_m = float(kVoxel);
      noise_deg.push_back(normal_noise_deg(map, places.back().contact.voxel, band));
      Eigen::Vector3d n;
      for (int axis = 0; axis < 3; ++axis)
        n[axis] = signed_distance_m(thing, t.position_m + 1e-4 * Eigen::Vector3d::Unit(axis)) -
                  signed_distance_m(thing, t.position_m - 1e-4 * Eigen::Vector3d::Unit(axis));
      normals.push_back(n.normalized()), points.push_back(t.position_m), things.push_back(&thing);
    }
    const auto height = [&](size_t p, int v) {
      const Index3& i = s.voxel[size_t(v)];
      return std::abs(normals[p].dot(Eigen::Vector3d(i.x, i.y, i.z) * kVoxel - points[p]));
    };
    std::vector<std::vector<char>> faces;
    for (size_t p = 0; p < places.size(); ++p) {
      const auto of_face = [&](int v) {
        const Index3& i = s.voxel[size_t(v)];
        const Eigen::Vector3d at = Eigen::Vector3d(i.x, i.y, i.z) * kVoxel;
        // Voxels at the foot of a wall lie within the floor's band too, but are the wall's.
        return height(p, v) <= 1.5 * kVoxel && std::abs(signed_distance_m(*things[p], at)) <= 1.5 * kVoxel &&
               &scene.primitives[size_t(nearest_surface(scene, at).primitive)] == things[p];
      };
      faces.push_back(flooded(s, places[p].seed, of_face));
      for (size_t v = 0; v < s.voxel.size(); ++v) faces.back()[v] = faces.back()[v] && of_face(int(v));
    }
    compare(map, s, places, [&](size_t p, size_t column, const std::vector<char>& region) {
      double face = 0, both = 0, off = 0, all = 0;
      for (size_t v = 0; v < region.size(); ++v) {
        face += faces[p][v];
        both += faces[p][v] && region[v];
        all += region[v];
        off += region[v] && height(p, int(v)) > 2.5 * kVoxel;
      }
      whole[column].push_back(both / face);
      leaks[column] += off > 0;
      large[column] += off > 0.02 * all;
    });
  }
  for (size_t c = 0; c < kColumns; ++c)
    std::printf("| %s | %.1f | %s | %.2f | %.2f | %d | %d of %zu |\n", name.c_str(), quantile_of(noise_deg, 0.5),
                rule_text(c).c_str(), quantile_of(whole[c], 0.5), quantile_of(whole[c], 0.25), leaks[c], large[c],
                whole[c].size());
  std::fflush(stdout);
}

void recorded_map(const std::string& name, int64_t frames, int64_t step) {
  constexpr double kVoxel = 0.02;
  const auto sequence = open_sequence(bench::recorded(name), {.read_color = false});
  Map map(kVoxel, 4 * kVoxel);
  IntegrationScratch scratch;
  for (int64_t i = 0; i < frames && i * step < sequence->size(); ++i) {
    ReadResult result = sequence->read(i * step);
    if (const Frame* frame = std::get_if<Frame>(&result)) integrate(map, *frame, {}, scratch);
  }
  const Surface s = surface_of(map);
  std::mt19937 rng(1);
  std::vector<Place> places;
  std::vector<double> noise_deg, voxels[kColumns], bent[kColumns];
  for (int i = 0; i < 60; ++i) {
    const Index3 v = s.voxel[rng() % s.voxel.size()];
    const Contact contact = find_contact(map, Eigen::Vector3d(v.x, v.y, v.z) * kVoxel, {});
    places.push_back({contact, s.number.at(contact.voxel)});
    SurfaceRule band;
    band.band_m = float(kVoxel);
    noise_deg.push_back(normal_noise_deg(map, contact.voxel, band));
  }
  compare(map, s, places, [&](size_t p, size_t column, const std::vector<char>& region) {
    double all = 0, turned = 0;
    for (size_t v = 0; v < region.size(); ++v) {
      all += region[v];
      turned += region[v] && s.normal[voxels125][v].dot(s.normal[voxels125][size_t(places[p].seed)]) < 0.5f;
    }
    voxels[column].push_back(all);
    bent[column].push_back(turned / all);
  });
  for (size_t c = 0; c < kColumns; ++c)
    std::printf("| %s, %lld frames | %.1f | %s | %.0f | %.0f | %.2f |\n", name.c_str(), static_cast<long long>(frames),
                quantile_of(noise_deg, 0.5), rule_text(c).c_str(), quantile_of(voxels[c], 0.5),
                quantile_of(voxels[c], 0.75), quantile_of(bent[c], 0.75));
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "all";
  if (what != "recorded") {
    std::printf(
        "| rooms at 3 cm | noise, degrees | normals, limit in degrees | share of the touched face, median | lower "
        "quartile | regions that leave it | by more than 2 %% |\n|---|---|---|---|---|---|---|\n");
    rooms("24 frames, exact depth", 24, false);
    rooms("24 frames, sensor noise", 24, true);
    rooms("6 frames, sensor noise", 6, true);
  }
  if (what != "rooms") {
    std::printf(
        "\n| recorded, 2 cm | noise, degrees | normals, limit in degrees | voxels of a region, median | upper quartile "
        "| share turned by more than 60 degrees, upper quartile |\n|---|---|---|---|---|---|\n");
    recorded_map("tum_fr1_rpy", 5, 3);
    recorded_map("tum_fr1_rpy", 30, 1);
    recorded_map("7scenes_redkitchen", 3, 10);
    recorded_map("7scenes_redkitchen", 160, 1);
  }
}
