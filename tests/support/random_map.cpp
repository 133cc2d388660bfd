#include "tests/support/random_map.h"

#include <random>

namespace felt::test {

Map random_map(const RandomMapOptions& options) {
  std::mt19937_64 engine(options.seed);
  const auto real = [&](float low, float high) { return std::uniform_real_distribution<float>(low, high)(engine); };
  const auto integer = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine); };
  Map map(0.02, 0.08);
  std::vector<ClassInfo> classes;
  for (int i = 0; i < options.classes; ++i)
    classes.push_back({.id = uint16_t(i + 1), .name = "class " + std::to_string(i), .color = default_class_color(i)});
  if (!classes.empty()) {
    classes.push_back({0, "void", {}, true});
    map.classes = ClassTable(classes);
  }
  const int span = 2 + options.blocks / 8;
  while (int(map.store.size()) < options.blocks) {
    const uint32_t known = uint32_t(map.store.size());
    const uint32_t number =
        map.store.find_or_create({integer(-span, span), integer(-span, span), integer(-span, span)});
    if (number < known) continue;
    Block& block = map.store[number];
    const bool colored = options.color && integer(0, 4) != 0;
    ColorPlanes* color = colored ? &map.store.add_color(block) : nullptr;
    for (int slot = 0; slot < options.classes; ++slot)
      if (integer(0, 2) != 0) block.evidence.push_back({uint16_t(slot), map.store.new_plane()});
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (i != 100 && integer(0, 3) == 0) continue;
      block.geometry->tsdf[i] = real(-0.08f, 0.08f);
      block.geometry->weight[i] = real(0.1f, 60.0f);
      if (color != nullptr && integer(0, 5) != 0) {
        color->r[i] = uint16_t(integer(0, 0xff00));
        color->g[i] = uint16_t(integer(0, 0xff00));
        color->b[i] = uint16_t(integer(0, 0xff00));
        color->count[i] = uint16_t(integer(1, 0xffff));
      }
      for (EvidencePlane& plane : block.evidence)
        if (integer(0, 1) != 0) plane.counts->value[i] = real(0.0f, 20.0f);
    }
  }
  std::mt19937_64 more(options.seed + 1);
  const auto chance = [&](int one_in) { return more() % uint64_t(one_in) == 0; };
  for (Block& block : map.store.blocks()) {
    if (options.shared_evidence && !chance(3)) block.even_evidence = map.store.new_plane();
    if (options.instances && !chance(3)) map.store.add_instance(block);
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (!(block.geometry->weight[i] > 0)) continue;
      if (block.even_evidence != nullptr && chance(2)) block.even_evidence->value[i] = float(more() % 100) / 8;
      if (block.instance != nullptr && chance(2))
        block.instance->id[i] = uint16_t(1 + more() % 0xffff), block.instance->votes[i] = uint16_t(more() % 9);
    }
  }
  for (int64_t frame = 0; frame < 20; frame += 2)
    record_frame(map.frames, "0123abcd", "{\"voxel_size_m\":0.02}", frame);
  record_frame(map.frames, "0123abcd", "{\"voxel_size_m\":0.02}", 55);
  record_frame(map.frames, "ffee0000", "", 3);
  map.metadata = {{"config", "voxel_size: 0.02\n"}, {"empty", ""}};
  return map;
}

}  // namespace felt::test
