#include "apps/output/reconstruct_report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

namespace felt::apps {

double percentile(std::vector<double> values, double p) {
  if (values.empty()) return 0;
  const auto rank = size_t(std::ceil(p * double(values.size())));
  const auto nth = values.begin() + std::ptrdiff_t(std::clamp<size_t>(rank, 1, values.size()) - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

nlohmann::ordered_json to_json(const ReconstructReport& report, const nlohmann::ordered_json& config) {
  const FusionRecord& fusion = report.fusion;
  const std::vector<double>& ms = fusion.frame_ms;
  const double mean_ms = ms.empty() ? 0 : std::accumulate(ms.begin(), ms.end(), 0.0) / double(ms.size());
  nlohmann::ordered_json skipped = nlohmann::ordered_json::object();
  for (const auto& [reason, count] : fusion.skipped) skipped[reason] = count;

  nlohmann::ordered_json json;
  json["frames"] = {{"read", fusion.read}, {"fused", fusion.fused}, {"skipped", skipped}};
  if (report.resumed_after > 0) json["frames"]["resumed_after"] = report.resumed_after;
  if (!fusion.stopped.empty()) json["stopped"] = fusion.stopped;
  json["voxel_size_m"] = report.voxel_size_m;
  json["truncation_m"] = report.truncation_m;
  json["blocks"] = report.blocks;
  json["active_voxels"] = report.active_voxels;
  json["bytes"] = {{"tsdf", report.tsdf_bytes},
                   {"color", report.color_bytes},
                   {"classes", report.class_bytes},
                   {"instances", report.instance_bytes},
                   {"properties", report.property_bytes},
                   {"total", report.tsdf_bytes + report.color_bytes + report.class_bytes + report.instance_bytes +
                                 report.property_bytes}};
  if (report.classes > 0) {
    nlohmann::ordered_json unknown = nlohmann::ordered_json::object();
    for (const auto& [id, pixels] : fusion.unknown_ids) unknown[std::to_string(id)] = pixels;
    json["labels"] = {{"classes", report.classes},
                      {"voxel_observations", fusion.labels.voxels},
                      {"unknown_observations", fusion.labels.unknown},
                      {"invalid_observations", fusion.labels.invalid},
                      {"unknown_id_pixels", unknown},
                      {"ignored_pixels", fusion.ignored_pixels},
                      {"frames_without", fusion.without_labels}};
  }
  json["peak_rss_bytes"] = report.peak_rss_bytes;
  json["time_s"] = {{"total", report.total_s}, {"decode", fusion.decode_s},        {"network", fusion.network_s},
                    {"vote", fusion.vote_s},   {"wait_for_decode", fusion.wait_s}, {"allocate", fusion.allocate_s},
                    {"fuse", fusion.fuse_s},   {"touch", report.touch_s},          {"mesh", report.mesh_s},
                    {"save", report.save_s}};
  json["fuse_ms"] = {{"mean", mean_ms}, {"p50", percentile(ms, 0.50)}, {"p95", percentile(ms, 0.95)}};
  json["threads"] = report.threads;
  json["simd"] = report.simd;
  json["map_hash"] = report.map_hash;
  json["mesh"] = {{"vertices", report.mesh_vertices}, {"triangles", report.mesh_triangles}};
  json["config"] = config;
  return json;
}

}  // namespace felt::apps
