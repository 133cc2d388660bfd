// Experiment
#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>
#include <unordered_map>
#include <queue>

#include "bench/support/bench.h"
#include "core/simd.h"
#include "io/simulation/render_sequence.h"
#include "io/simulation/scene.h"
#include "io/simulation/touches.h"
#include "io/simulation/trajectory.h"
#include "mapping/region_query.h"
#include "mapping/tsdf_integrator.h"

namespace {
using namespace felt;
using V3 = Eigen::Vector3f;

struct Surf {
  std::vector<Index3> v;
  std::unordered_map<Index3, int> at;
  std::vector<V3> n[3];
};

float tsdf_at(const Map& m, const Index3& v) {
  const Block* b = m.store.get(block_of_voxel(v));
  const int i = offset_in_block(v);
  return b != nullptr && b->geometry->weight[i] >= 1 ? b->geometry->tsdf[i] : NAN;
}
float diff(float a, float h, float c) {
  if (!std::isnan(a) && !std::isnan(c)) return 0.5f * (c - a);
  return !std::isnan(c) ? c - h : !std::isnan(a) ? h - a : 0.0f;
}

V3 normal_r(const Map& m, const Index3& v, int r) {
  // mean over (2r+1)^2 lines of slopes; r=2 uses 5-point regression where whole, else 3 point
  V3 g(0, 0, 0);
  for (int axis = 0; axis < 3; ++axis) {
    double sum = 0; int count = 0;
    for (int a = -r; a <= r; ++a)
      for (int b = -r; b <= r; ++b) {
        const auto p = [&](int s) {
          Index3 u = v;
          int d[3]; d[axis] = s; d[(axis + 1) % 3] = a; d[(axis + 2) % 3] = b;
          u.x += d[0]; u.y += d[1]; u.z += d[2];
          return tsdf_at(m, u);
        };
        const float h = p(0), lo = p(-1), hi = p(1);
        if (std::isnan(h) || (std::isnan(lo) && std::isnan(hi))) continue;
        float s = diff(lo, h, hi);
        if (r == 2) {
          const float l2 = p(-2), h2 = p(2);
          if (!std::isnan(lo) && !std::isnan(hi) && !std::isnan(l2) && !std::isnan(h2)) s = (2 * (h2 - l2) + hi - lo) / 10;
        }
        sum += s; ++count;
      }
    g[axis] = count ? float(sum / count) : 0;
  }
  const float l = g.norm();
  return l > 0 ? V3(g / l) : V3(0, 0, 0);
}

Surf surf_of(const Map& m) {
  Surf s;
  for (const uint32_t n : m.store.sorted()) {
    const Block& b = m.store[n];
    const Index3 f = first_voxel(b.coord);
    for (int i = 0; i < 512; ++i)
      if (b.geometry->weight[i] >= 1 && std::abs(b.geometry->tsdf[i]) <= float(m.voxel_size_m)) {
        const Index3 o = voxel_of_offset(i);
        s.at[{f.x + o.x, f.y + o.y, f.z + o.z}] = int(s.v.size());
        s.v.push_back({f.x + o.x, f.y + o.y, f.z + o.z});
      }
  }
  for (int r = 0; r < 3; ++r)
    for (const Index3& v : s.v) s.n[r].push_back(normal_r(m, v, r));
  return s;
}

struct Rule { int r, R, J; float deg; float frac; };

std::vector<char> interior_of(const Surf& s, const Rule& rule) {
  const float c = std::cos(rule.deg * float(std::numbers::pi) / 180);
  std::vector<char> in(s.v.size());
  for (size_t k = 0; k < s.v.size(); ++k) {
    int bad = 0, all = 0;
    for (int x = -rule.R; x <= rule.R; ++x)
      for (int y = -rule.R; y <= rule.R; ++y)
        for (int z = -rule.R; z <= rule.R; ++z) {
          const auto f = s.at.find({s.v[k].x + x, s.v[k].y + y, s.v[k].z + z});
          if (f == s.at.end() || size_t(f->second) == k) continue;
          ++all;
          bad += s.n[rule.r][k].dot(s.n[rule.r][f->second]) < c;
        }
    in[k] = float(bad) <= rule.frac * float(all);
  }
  return in;
}

std::vector<char> flood(const Surf& s, const Rule& rule, const std::vector<char>& in, int seed) {
  const float c = std::cos(rule.deg * float(std::numbers::pi) / 180);
  std::vector<char> got(s.v.size(), 0), grown(s.v.size(), 0);
  std::queue<int> q;
  const auto near = [&](int k, int R, const auto& f) {
    for (int x = -R; x <= R; ++x)
      for (int y = -R; y <= R; ++y)
        for (int z = -R; z <= R; ++z) {
          const auto it = s.at.find({s.v[k].x + x, s.v[k].y + y, s.v[k].z + z});
          if (it != s.at.end()) f(it->second);
        }
  };
  near(seed, 1, [&](int u) {
    if (u != seed && s.n[rule.r][seed].dot(s.n[rule.r][u]) < c) return;
    got[u] = 1;
    if (in[u] && !grown[u]) grown[u] = 1, q.push(u);
  });
  while (!q.empty()) {
    const int k = q.front();
    q.pop();
    near(k, rule.J, [&](int u) { got[u] = 1; });
    near(k, 1, [&](int u) {
      if (in[u] && !grown[u]) grown[u] = 1, q.push(u);
    });
  }
  return got;
}

const Rule kRules[] = {{0, 1, 1, 20, 0}, {0, 1, 1, 30, 0}, {0, 1, 1, 45, 0}, {1, 1, 1, 20, 0}, {1, 1, 1, 25, 0}, {1, 1, 1, 30, 0},
                       {2, 1, 1, 15, 0}, {2, 1, 1, 20, 0}, {2, 2, 1, 20, 0}, {2, 2, 2, 20, 0}, {2, 2, 2, 25, 0}, {2, 2, 1, 30, 0},{1, 1, 1, 20, 0.1f}, {2, 2, 1, 20, 0.1f}};

void noise_line(const Surf& s) {
  for (int r = 0; r < 3; ++r) {
    std::vector<double> a;
    for (size_t k = 0; k < s.v.size(); k += 7)
      for (int d = 0; d < 3; ++d) {
        const auto f = s.at.find({s.v[k].x + (d == 0), s.v[k].y + (d == 1), s.v[k].z + (d == 2)});
        if (f != s.at.end()) a.push_back(std::acos(std::clamp(s.n[r][k].dot(s.n[r][f->second]), -1.f, 1.f)) * 57.3);
      }
    std::sort(a.begin(), a.end());
    std::printf("  r=%d neighbour angle: median %.1f p75 %.1f p90 %.1f\n", r, a[a.size() / 2], a[a.size() * 3 / 4], a[a.size() * 9 / 10]);
  }
}

void rooms(double voxel, int frames, bool noisy) {
  std::vector<double> cover[std::size(kRules)], leak[std::size(kRules)];
  for (int room = 1; room <= 4; ++room) {
    const Scene scene = make_scene("room" + std::to_string(room));
    const Trajectory trajectory = standard_trajectory(scene, frames);
    const PinholeCamera camera = simulated_camera(320, 240);
    RenderOptions options;
    options.with_color = false;
    if (noisy) options.noise = DepthNoise{};
    Map map(voxel, 4 * voxel);
    IntegrationScratch scratch;
    for (size_t i = 0; i < trajectory.size(); ++i) integrate(map, render_frame(scene, camera, trajectory[i], int64_t(i), options), {}, scratch);
    const Surf s = surf_of(map);
    if (room == 1) { std::printf("rooms voxel %.3f frames %d noise %d: %zu band voxels\n", voxel, frames, noisy, s.v.size()); noise_line(s); }
    TouchOptions to;
    to.count = 12;
    const PropertyTable properties = simulated_properties();
    std::vector<int> seeds, prims;
    std::vector<Eigen::Vector3d> pos, nrm;
    for (const SimulatedTouch& t : simulate_touches(scene, trajectory, camera, properties[0], to)) {
      const NearestSurface nearest = nearest_surface(scene, t.position_m);
      const Primitive& p = scene.primitives[size_t(nearest.primitive)];
      if (p.shape != ShapeKind::plane && p.shape != ShapeKind::box) continue;
      try {
        const Contact c = find_contact(map, t.position_m, {});
        seeds.push_back(s.at.at(c.voxel));
      } catch (const TouchError&) { continue; }
      Eigen::Vector3d n;
      for (int a = 0; a < 3; ++a)
        n[a] = signed_distance_m(p, t.position_m + 1e-4 * Eigen::Vector3d::Unit(a)) - signed_distance_m(p, t.position_m - 1e-4 * Eigen::Vector3d::Unit(a));
      nrm.push_back(n.normalized()), pos.push_back(t.position_m), prims.push_back(nearest.primitive);
    }
    for (size_t r = 0; r < std::size(kRules); ++r) {
      const auto in = interior_of(s, kRules[r]);
      for (size_t k = 0; k < seeds.size(); ++k) {
        const auto got = flood(s, kRules[r], in, seeds[k]);
        // truth: connected component of voxels of the face
        std::vector<char> face(s.v.size(), 0), none(s.v.size(), 1);
        size_t hit = 0, whole = 0, off = 0, size = 0;
        std::queue<int> q;
        const auto on_face = [&](int u) {
          const Eigen::Vector3d p = Eigen::Vector3d(s.v[u].x, s.v[u].y, s.v[u].z) * voxel;
          return std::abs(nrm[k].dot(p - pos[k])) <= 1.5 * voxel && std::abs(signed_distance_m(scene.primitives[size_t(prims[k])], p)) <= 1.5 * voxel;
        };
        face[seeds[k]] = 1; q.push(seeds[k]);
        while (!q.empty()) {
          const int u = q.front(); q.pop();
          for (int i = 0; i < 27; ++i) {
            const auto it = s.at.find({s.v[u].x + i / 9 - 1, s.v[u].y + i / 3 % 3 - 1, s.v[u].z + i % 3 - 1});
            if (it != s.at.end() && !face[it->second] && on_face(it->second)) face[it->second] = 1, q.push(it->second);
          }
        }
        for (size_t u = 0; u < s.v.size(); ++u) {
          const Eigen::Vector3d p = Eigen::Vector3d(s.v[u].x, s.v[u].y, s.v[u].z) * voxel;
          whole += face[u]; hit += face[u] && got[u]; size += got[u];
          off += got[u] && std::abs(nrm[k].dot(p - pos[k])) > 2.5 * voxel;
        }
        cover[r].push_back(double(hit) / double(whole));
        leak[r].push_back(double(off) / double(std::max<size_t>(1, size)));
      }
    }
  }
  for (size_t r = 0; r < std::size(kRules); ++r) {
    std::vector<double> c = cover[r];
    std::sort(c.begin(), c.end());
    int leaks = 0, big = 0;
    for (double l : leak[r]) leaks += l > 0, big += l > 0.02;
    std::printf("  r%d R%d J%d %2.0f f%.1f: cover median %.2f p25 %.2f p10 %.2f; leaks %d, big %d of %zu\n", kRules[r].r, kRules[r].R, kRules[r].J, kRules[r].deg, kRules[r].frac, c[c.size() / 2],
                c[c.size() / 4], c[c.size() / 10], leaks, big, c.size());
  }
  std::fflush(stdout);
}

void real(const char* name, double voxel, int frames, int step) {
  const auto seq = open_sequence(bench::recorded(name), {.read_color = false});
  Map map(voxel, 4 * voxel);
  IntegrationScratch scratch;
  for (int i = 0; i < frames && i * step < seq->size(); ++i) {
    ReadResult r = seq->read(i * step);
    if (Frame* f = std::get_if<Frame>(&r)) integrate(map, *f, {}, scratch);
  }
  const Surf s = surf_of(map);
  std::printf("%s voxel %.3f frames %d: %zu band\n", name, voxel, frames, s.v.size());
  noise_line(s);
  std::mt19937 rng(1);
  std::vector<int> seeds;
  for (int i = 0; i < 60; ++i) seeds.push_back(int(rng() % s.v.size()));
  for (const Rule& rule : kRules) {
    const auto in = interior_of(s, rule);
    std::vector<double> size, bent;
    for (int seed : seeds) {
      const auto got = flood(s, rule, in, seed);
      size_t n = 0, b = 0;
      for (size_t u = 0; u < got.size(); ++u) n += got[u], b += got[u] && s.n[2][u].dot(s.n[2][seed]) < 0.5f;
      size.push_back(double(n)), bent.push_back(double(b) / double(n));
    }
    const size_t interior = size_t(std::count(in.begin(), in.end(), 1));
    std::sort(size.begin(), size.end());
    std::sort(bent.begin(), bent.end());
    std::printf("  r%d R%d J%d %2.0f f%.1f: interior %.2f; size p25 %.0f median %.0f p75 %.0f; bent > 60 deg p75 %.2f p90 %.2f\n", rule.r, rule.R, rule.J, rule.deg, rule.frac,
                double(interior) / double(s.v.size()), size[15], size[30], size[45], bent[45], bent[54]);
  }
  std::fflush(stdout);
}
}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "rooms";
  if (what == "rooms") {
    rooms(0.03, 6, true), rooms(0.03, 24, true), rooms(0.03, 24, false), rooms(0.02, 6, true), rooms(0.02, 24, true), rooms(0.05, 6, true);
  } else {
    real("tum_fr1_rpy", 0.02, 5, 3), real("tum_fr1_rpy", 0.02, 30, 1), real("7scenes_redkitchen", 0.02, 3, 10), real("7scenes_redkitchen", 0.02, 160, 1), real("open3d_redwood_5", 0.02, 5, 1), real("sun3d_nvblox_5", 0.02, 5, 1), real("tum_fr1_rpy", 0.04, 5, 3);
  }
}
