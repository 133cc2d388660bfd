#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "mapping/fusion/label_fusion.h"

namespace felt::apps {

/// What fusing a sequence did, gathered frame by frame.
struct FusionRecord {
  int64_t read = 0;  ///< frames taken from the sequence, fused or not
  int64_t fused = 0;
  std::map<std::string, int64_t> skipped;  ///< by reason
  double decode_s = 0;                     ///< summed over decoding threads
  double network_s = 0;                    ///< the same, in the segmenter
  double vote_s = 0;                       ///< the same, in segments and voting
  double wait_s = 0;                       ///< that fusion waited for a decoded frame
  double allocate_s = 0, fuse_s = 0;
  std::vector<double> frame_ms;              ///< of each fused frame: allocation and update of all channels
  LabelStats labels;                         ///< summed over frames
  std::map<uint16_t, uint64_t> unknown_ids;  ///< label ids that the class table does not know, with their pixels
  uint64_t ignored_pixels = 0;               ///< of --ignore-classes
  int64_t without_labels = 0;                ///< fused frames that carried neither labels nor probabilities
  std::string stopped;                       ///< why fusion ended before the last frame; empty: it did not
};

/// Everything that `report.json` of reconstruct says.
struct ReconstructReport {
  FusionRecord fusion;
  double voxel_size_m = 0, truncation_m = 0;
  size_t blocks = 0, active_voxels = 0;
  size_t tsdf_bytes = 0, color_bytes = 0, class_bytes = 0, instance_bytes = 0, property_bytes = 0;
  int classes = 0;  ///< of the table, without the ignored ones
  size_t peak_rss_bytes = 0;
  double touch_s = 0, mesh_s = 0, save_s = 0, total_s = 0;
  int threads = 1;
  std::string simd;
  std::string map_hash;
  int64_t resumed_after = 0;  ///< frames that an earlier run had read
  size_t mesh_vertices = 0, mesh_triangles = 0;
};

/// The value below which a share `p` of `values` lies (nearest rank); 0 where there are none.
double percentile(std::vector<double> values, double p);

/// `config`: the settings as used. Others rely on the keys: none may change.
nlohmann::ordered_json to_json(const ReconstructReport& report, const nlohmann::ordered_json& config);

}  // namespace felt::apps
