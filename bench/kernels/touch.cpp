// Region query plus touch update of a region of about 100,000 voxels, one thread, as docs/measures.md asks. Every voxel
// has counts of its own, so that the mixture model has as many states as voxels.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>
#include <cstdint>
#include <string>
#include <vector>

#include <cmath>
#include <random>
#include <span>

#include "inference/mixture.h"
#include "mapping/touch/touch_mixture.h"
#include "mapping/touch/touch_update.h"

namespace {
using namespace felt;

/// A square floor of side x side voxels, two in its band, with k classes of which every voxel saw three, with counts
/// drawn per voxel; the first class is always the strongest.
Map floor_map(int side, int k) {
  Map map(0.02, 0.08);
  std::vector<ClassInfo> classes;
  Property friction;
  friction.name = "friction";
  for (int c = 0; c < k; ++c) {
    classes.push_back({uint16_t(c + 1), "class " + std::to_string(c), {}, false});
    friction.priors["class " + std::to_string(c)] = {0.2 + 0.4 * c / k, 0.06, 50};
  }
  map.classes = ClassTable(classes);
  map.properties = PropertyTable({friction});
  std::mt19937 rng(1);
  for (int x = 0; x < side; ++x)
    for (int y = 0; y < side; ++y)
      for (int z = 0; z < 8; ++z) {
        Block& block = map.store[map.store.find_or_create(block_of_voxel({x, y, z}))];
        const int i = offset_in_block({x, y, z});
        block.geometry->tsdf[i] = float((z - 3.3) * map.voxel_size_m);
        block.geometry->weight[i] = 5;
        if (block.evidence.empty())
          for (int c = 0; c < 3; ++c) block.evidence.push_back({uint16_t(c), map.store.new_plane()});
        for (int c = 0; c < 3; ++c)
          block.evidence[size_t(c)].counts->value[i] = float(c == 0 ? 20 : 0) + float(rng() % 100000) * 1e-4f;
      }
  return map;
}

TouchRequest reading(TouchModel model) {
  TouchRequest request;
  request.point_m = {1, 1, 3.3 * 0.02};
  request.property = "friction";
  request.value = 0.27;
  request.model = model;
  return request;
}

/// Whether the batch gave what the scalar library gives: the posterior of the pooled belief, or each voxel's own update
/// (every 991st voxel).
std::string faults(Map& map, TouchModel model) {
  const uint64_t id = add_touch(map, resolve_touch(map, reading(model)));
  const Touch& recorded = *map.touches.find(id);
  const size_t k = size_t(map.classes.size());
  const std::vector<Nig> priors = nig_priors(map.properties[0], map.classes);
  std::string fault;
  if (touch_plane_bytes(map) != 3 * sizeof(Plane) * recorded.region.blocks()) fault = "planes in untouched blocks";
  if (model == TouchModel::material) {
    const double psi = recorded.request.value;
    const MaterialPosterior scalar =
        material_posterior(pooled_belief(map, recorded.region), priors, std::span(&psi, 1), {}, map.properties[0].rho);
    const Belief belief = Beliefs(map).of(recorded.region, {0});
    for (size_t c = 0; c < k; ++c)
      if (std::abs(belief.class_probability[c] - scalar.belief.p[c]) > 1e-12) fault = "another posterior";
  } else {
    size_t n = 0;
    for (const MixtureBlock& block : mixture_state(map, recorded.region).blocks)
      for (size_t i = 0; i < block.voxels; ++i) {
        if (n++ % 991 != 0) continue;
        std::vector<double> vision;
        size_t left = i;
        for_each_bit(block.mask, [&](int offset) {
          if (left-- != 0) return;
          vision.assign(k, map.classes.prior(0));
          for (const EvidencePlane& e : map.store.get(block.coord)->evidence)
            vision[e.slot] += double(e.counts->value[offset]);
        });
        const MixtureUpdate scalar = mixture_update(vision, priors, recorded.request.value, 0, Projection::kl);
        for (size_t c = 0; c < k; ++c)
          if (std::abs(double(block.a[c * block.voxels + i]) - scalar.a[c]) > 1e-4 * scalar.a[c])
            fault = "another state";
      }
  }
  undo_touch(map, id);
  map.touches.touches.clear();
  return fault;
}

void touch(benchmark::State& state, TouchModel model) {
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, 1);
  Map map = floor_map(int(state.range(0)), int(state.range(1)));
  if (const std::string fault = faults(map, model); !fault.empty()) {
    state.SkipWithError(fault.c_str());
    return;
  }
  size_t voxels = 0, computed = 0;
  for (auto _ : state) {
    const uint64_t id = add_touch(map, resolve_touch(map, reading(model)));
    const Touch& recorded = *map.touches.find(id);
    voxels = recorded.region.voxels();
    if (model == TouchModel::material) {
      benchmark::DoNotOptimize(Beliefs(map).of(recorded.region, {0}));
    } else {
      computed = 0;
      for (const MixtureBlock& block : mixture_state(map, recorded.region).blocks) computed += block.voxels;
    }
    state.PauseTiming();
    undo_touch(map, id);
    map.touches.touches.clear();
    state.ResumeTiming();
  }
  if (voxels != size_t(2 * state.range(0) * state.range(0))) state.SkipWithError("the region is not the floor");
  if (model == TouchModel::mixture && computed != voxels) state.SkipWithError("not every voxel has a state");
  state.counters["voxels"] = double(voxels);
  state.counters["ns/voxel"] = benchmark::Counter(double(voxels) * double(state.iterations()) * 1e-9,
                                                  benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
void query_and_material(benchmark::State& state) { touch(state, TouchModel::material); }
void query_and_mixture(benchmark::State& state) { touch(state, TouchModel::mixture); }

/// So many noisy touches of a floor, discs of 10 cm radius that overlap in all ways, each with its report.
void batch_of_touches(benchmark::State& state) {
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, 1);
  size_t counted = 0;
  for (auto _ : state) {
    state.PauseTiming();
    Map map = floor_map(112, 8);
    std::mt19937 rng(2);
    std::uniform_real_distribution<double> place(0.2, 2.0), value(0.2, 0.5);
    state.ResumeTiming();
    TouchBatch batch(map);
    for (int n = 0; n < state.range(0); ++n) {
      TouchRequest request = reading(TouchModel::material);
      request.stamp_s = n;
      request.point_m = {place(rng), place(rng), 3.3 * 0.02};
      request.value = value(rng);
      request.sigma = 0.02;
      request.region.rule = RegionRule::sphere;
      request.region.radius_m = 0.1;
      batch.apply(resolve_touch(map, request));
    }
    batch.finish();
    counted = map.touches.touches.size();
  }
  if (counted != size_t(state.range(0))) state.SkipWithError("not every touch counts");
  state.counters["ms/touch"] = benchmark::Counter(double(state.range(0)) * double(state.iterations()) * 1e-3,
                                                  benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(batch_of_touches)->Arg(1)->Arg(10)->Arg(100)->Arg(1000)->Unit(benchmark::kMillisecond);

void sizes(benchmark::internal::Benchmark* b) {
  b->Args({112, 8})->Args({224, 8})->Args({448, 8})->Args({224, 40});
  b->Unit(benchmark::kMillisecond);
}
BENCHMARK(query_and_material)->Apply(sizes);
BENCHMARK(query_and_mixture)->Apply(sizes);

}  // namespace

BENCHMARK_MAIN();
