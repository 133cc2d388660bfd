// A picture of what becomes of a network's labels, one row a frame: colour, the network's labels, the labels voted
// within geometric segments, and the labels of a map rendered back into the frame.
//
//   bench_perception_picture NET.yaml SEQUENCE MAP.vdb OUT.png FRAME...
//
// FRAME: positions in the sequence. MAP: of `reconstruct SEQUENCE --segmenter NET.yaml`, with or without --vote.
#include <cstdio>
#include <cstdlib>

#include "bench/support/bench.h"
#include "io/map_file/map_file.h"
#include "io/pictures/picture.h"
#include "io/segmentation/segment_source.h"
#include "io/segmentation/segmenter.h"
#include "mapping/labels/segment_voting.h"
#include "mapping/surface/render.h"
#include "mapping/surface/render_classes.h"
#include "mapping/touch/voxel_beliefs.h"

namespace {
using namespace felt;

constexpr int kShrink = 2, kGap = 6;

void paste(const ColorImage& image, int left, int top, ColorImage& canvas) {
  for (int v = 0; v < image.height() / kShrink; ++v)
    for (int u = 0; u < image.width() / kShrink; ++u) canvas(left + u, top + v) = image(u * kShrink, v * kShrink);
}

/// The class's colour over a fainter picture, so that one sees what is labelled; black where there is no class.
ColorImage tinted(const LabelImage& labels, const ClassTable& classes, const ColorImage& color) {
  ColorImage out(labels.width(), labels.height(), {0, 0, 0, 255});
  for (size_t p = 0; p < labels.size(); ++p) {
    const uint16_t slot = classes.slot_of_id(labels.data()[p]);
    if (slot == ClassTable::kNoSlot) continue;
    const Rgba8 &c = classes.at_slot(slot).color, &from = color.data()[p];
    const int grey = (from.r + 2 * from.g + from.b) / 4;
    const auto mix = [&](int channel) { return uint8_t((3 * channel + grey) / 4); };
    out.data()[p] = {mix(c.r), mix(c.g), mix(c.b), 255};
  }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 6) {
    std::fprintf(stderr, "usage: bench_perception_picture NET.yaml SEQUENCE MAP.vdb OUT.png FRAME...\n");
    return 2;
  }
  const Segmenter segmenter(read_net_description(argv[1]), {});
  const auto sequence = open_sequence(argv[2]);
  const Map map = load_map(argv[3]);
  if (!(map.classes == segmenter.classes())) {
    std::fprintf(stderr, "the map has other classes than the network\n");
    return 1;
  }
  const RayCaster caster(map);
  const VoxelBeliefs beliefs(map);
  const int width = sequence->info().camera.width / kShrink, height = sequence->info().camera.height / kShrink;
  ColorImage canvas(4 * width + 3 * kGap, (argc - 5) * (height + kGap) - kGap, {255, 255, 255, 255});
  for (int row = 0; row < argc - 5; ++row) {
    const ReadResult result = sequence->read(std::atoi(argv[5 + row]));
    const Frame& frame = std::get<Frame>(result);
    ProbabilityImage probabilities = segmenter.segment(frame.color, 5);
    const LabelImage raw = most_probable_labels(probabilities);
    pool_probabilities(segments_of(frame, SegmentSource::geometric), 0, probabilities);
    const RenderedView view = caster.render(frame.camera, frame.T_world_camera);
    const LabelImage columns[] = {raw, most_probable_labels(probabilities), class_image(map, beliefs, view.voxel)};
    paste(frame.color, 0, row * (height + kGap), canvas);
    for (int i = 0; i < 3; ++i)
      paste(tinted(columns[i], map.classes, frame.color), (i + 1) * (width + kGap), row * (height + kGap), canvas);
  }
  write_png(argv[4], canvas);
  std::printf("%s\n", argv[4]);
  return 0;
}
