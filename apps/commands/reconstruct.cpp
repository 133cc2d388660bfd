#include <spdlog/spdlog.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <functional>
#include <future>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/fusion/checkpoint.h"
#include "apps/fusion/fuse_sequence.h"
#include "apps/fusion/interrupt.h"
#include "apps/fusion/recorded_touches.h"
#include "apps/options/label_options.h"
#include "apps/options/problems.h"
#include "apps/options/reconstruct_options.h"
#include "apps/output/output_files.h"
#include "apps/output/progress.h"
#include "core/error.h"
#include "core/simd.h"
#include "core/stopwatch.h"
#include "core/text.h"
#include "io/doctor/doctor.h"
#include "io/files/atomic_file.h"
#include "io/files/json_text.h"
#include "io/files/system_memory.h"
#include "io/meshes/mesh_io.h"
#include "io/sequence/decode_ahead.h"
#include "io/sequence/open_sequence.h"
#include "io/sequence/skip_reasons.h"
#include "mapping/store/size_estimate.h"
#include "mapping/surface/marching_cubes.h"
#include "mapping/surface/surface_color.h"
#include "mapping/touch/touch_update.h"

namespace felt::apps {
namespace {
namespace fs = std::filesystem;

constexpr const char* kMapName = "map.vdb";
constexpr const char* kMeshName = "mesh.ply";
constexpr const char* kReportName = "report.json";

std::string gigabytes(double bytes) { return number_text(bytes / 1e9, "%.3g GB"); }

/// Refuses a map that cannot fit. Frames are decoded for this only where the worst case would not fit.
void check_memory(const SequenceReader& sequence, const ReconstructOptions& options) {
  const MapResolution resolution{options.voxel_size_m, options.truncation_m, options.reading.read_color};
  const auto available = double(available_memory_bytes());
  const auto bytes_of = [&](double area_m2) {
    return estimated_bytes(blocks_near_surface(area_m2, resolution), resolution);
  };
  const double most_m2 =
      double(sequence.size()) * largest_area_in_view_m2(sequence.info().camera, options.fusion.max_depth_m);
  if (bytes_of(most_m2) <= available) return;

  // Coarse enough that every 4th pixel fills the cells of a surface at a few metres.
  SurfaceEstimate surface(std::max(0.05, options.voxel_size_m * kBlockDim));
  constexpr int64_t kSamples = 8;
  for (int64_t i = 0; i < sequence.size(); i += std::max<int64_t>(1, sequence.size() / kSamples)) {
    const ReadResult result = sequence.read(i);
    if (const auto* frame = std::get_if<Frame>(&result))
      surface.add(*frame, options.fusion.min_depth_m, options.fusion.max_depth_m);
  }
  if (bytes_of(surface.area_m2()) <= available) return;
  throw ConfigError(describe_mismatch(
      "--voxel-size " + nlohmann::json(options.voxel_size_m).dump(),
      "memory for the " + number_text(surface.area_m2(), "%.3g m^2") + " of surface in sampled frames",
      "at most the " + gigabytes(available) + " available",
      "an estimate of " + gigabytes(bytes_of(surface.area_m2()))));
}

/// Working memory that must stay free to mesh and save what is fused.
bool memory_runs_out(const Map& map) {
  const MapResolution resolution{map.voxel_size_m, map.truncation_m, map.store.color_bytes() > 0};
  const auto held = double(map.store.geometry_bytes() + map.store.color_bytes());
  return double(available_memory_bytes()) < estimated_bytes(double(map.store.size()), resolution) - held + 64e6;
}

/// Saves the map on the way. What cannot be written now may be later: the run goes on, and the last one stays.
void try_checkpoint(const std::function<void()>& save, int64_t frames) {
  try {
    save();
    spdlog::info("checkpoint after {} frames", frames);
  } catch (const IoError& fault) {
    spdlog::warn("no checkpoint: {}", fault.what());
  }
}

/// Fuses what the record has not read yet.
void fuse(const SequenceReader& sequence, const FrameSource& source, const PerceptionTimes& perception,
          const ReconstructOptions& options, const std::vector<uint16_t>& ignored_ids, const CommonOptions& common,
          const InterruptGuard& interrupt, const std::function<void()>& save, Map& map, IntegrationScratch& scratch,
          FusionRecord& record) {
  ProgressBar progress("frames", sequence.size(), !common.quiet);
  DecodeAhead frames(sequence, {.threads = common.thread_count(), .first = record.read});
  const auto decode_s = [&] { return frames.decode_s() - perception.network_s() - perception.vote_s(); };
  fuse_sequence(frames, source, options.fusion, ignored_ids, map, scratch, record,
                [&](const FusionRecord& so_far) -> std::string {
                  progress.update(so_far.read, shares_text({{"network", perception.network_s()},
                                                            {"vote", perception.vote_s()},
                                                            {"decode", decode_s()},
                                                            {"fuse", so_far.allocate_s + so_far.fuse_s}}));
                  if (interrupt.requested()) return "interrupted";
                  constexpr int64_t kMemoryCheckEvery = 32;
                  if (so_far.read % kMemoryCheckEvery == 0 && memory_runs_out(map)) return "out of memory";
                  if (options.checkpoint_every > 0 && so_far.fused > 0 && so_far.read % options.checkpoint_every == 0 &&
                      so_far.read < sequence.size())
                    try_checkpoint(save, so_far.read);
                  return {};
                });
  record.network_s = perception.network_s();
  record.vote_s = perception.vote_s();
  record.decode_s = decode_s();
  record.wait_s = frames.wait_s();
}

/// "3 frames: 2 missing pose, 1 truncated depth image".
std::string nothing_fused(const FusionRecord& record) {
  const std::string frames = std::to_string(record.read) + " frames", reasons = skipped_text(record.skipped);
  return reasons.empty() ? frames : frames + ": " + reasons;
}

/// Map file and mesh, made side by side. The map is what cannot be made again: a mesh that fails does not stop its
/// saving, and is written behind it, so that it neither takes the room that the map needs nor lies beside another map.
void write_results(const Map& map, const std::function<std::string()>& save, const fs::path& folder, int threads,
                   ReconstructReport& report) {
  auto saving = std::async(threads > 1 ? std::launch::async : std::launch::deferred, [&] {
    const Stopwatch watch;
    report.map_hash = save();
    report.save_s = watch.seconds();
  });
  if (threads <= 1) saving.wait();
  TriangleMesh mesh;
  std::exception_ptr mesh_failure;
  try {
    const Stopwatch watch;
    std::vector<VertexEdge> edges;
    mesh = extract_mesh(map, {}, &edges);
    attach_beliefs(map, edges, mesh);
    report.mesh_s = watch.seconds();
  } catch (...) {
    mesh_failure = std::current_exception();
  }
  saving.get();
  if (mesh_failure) std::rethrow_exception(mesh_failure);
  const Stopwatch watch;
  warn_if_coarse(mesh, folder / kMeshName);
  try {
    write_ply(folder / kMeshName, mesh);
  } catch (const IoError& fault) {
    throw IoError(std::string(fault.what()) + "; the map is saved: feltmap export --mesh makes the mesh of it");
  }
  report.mesh_vertices = mesh.positions.size();
  report.mesh_triangles = mesh.triangles.size();
  report.mesh_s += watch.seconds();
}

/// Blocks that the map file holds: not those that were made for a frame and then not observed.
size_t observed_blocks(const Map& map) {
  const std::span<const Block> blocks = map.store.blocks();
  return size_t(
      std::count_if(blocks.begin(), blocks.end(), [](const Block& block) { return block.geometry->observed(); }));
}

/// What the map holds, and what it took by now.
void describe(const Map& map, const ReconstructOptions& options, ReconstructReport& report) {
  report.voxel_size_m = options.voxel_size_m, report.truncation_m = options.truncation_m;
  report.blocks = observed_blocks(map);
  report.active_voxels = active_voxel_count(map);
  report.tsdf_bytes = map.store.geometry_bytes(), report.color_bytes = map.store.color_bytes();
  report.property_bytes = touch_plane_bytes(map) + journal_bytes(map.touches);
  report.classes = map.classes.size();
  report.class_bytes = class_bytes(map);
  report.instance_bytes = map.store.instance_bytes();
  report.simd = simd_name();
  report.peak_rss_bytes = peak_resident_bytes();
}

/// What a run left out although it was asked for.
void warn_of_losses(const ReconstructReport& report, const ReconstructOptions& options, const Map& map) {
  const FusionRecord& fusion = report.fusion;
  const IntegrationConfig& config = options.fusion;
  if (report.mesh_triangles == 0)
    spdlog::warn("the map holds no surface: is there depth between {} and {} m, and are voxels of {} m small enough?",
                 config.min_depth_m, config.max_depth_m, options.voxel_size_m);
  if (!fusion.unknown_ids.empty()) {
    constexpr size_t kNamed = 8;
    uint64_t pixels = 0;
    for (const auto& [id, count] : fusion.unknown_ids) pixels += count;
    const auto id_of = [](const auto& counted) { return std::to_string(counted.first); };
    spdlog::warn("labels that the class table does not know, not fused: {} ({} pixels){}",
                 listed(fusion.unknown_ids, id_of, kNamed), pixels,
                 fusion.labels.voxels == 0 ? "; no voxel has a label: is it the table of these images?" : "");
  }
  if (options.reading.label_offset != 0 && fusion.unknown_ids.empty() && fusion.labels.voxels == 0 &&
      fusion.fused > fusion.without_labels && !map.classes.empty())
    spdlog::warn("no voxel has a label: --label-offset {} moves every id of the images out of range",
                 options.reading.label_offset);
  const bool any_instance = std::any_of(map.store.blocks().begin(), map.store.blocks().end(),
                                        [](const Block& block) { return block.instance != nullptr; });
  if (config.labels.instances && fusion.fused > 0 && !any_instance)
    spdlog::warn("--instances: expected frames with instance images, found none");
}

void print_summary(const ReconstructReport& report, const std::vector<TouchOutcome>& touched, const fs::path& folder) {
  const FusionRecord& fusion = report.fusion;
  std::printf("%lld of %lld frames fused in %.2f s: %zu blocks, %zu voxels; mesh of %zu triangles\n",
              static_cast<long long>(fusion.fused), static_cast<long long>(fusion.read), report.total_s, report.blocks,
              report.active_voxels, report.mesh_triangles);
  if (fusion.network_s + fusion.vote_s > 0)
    std::printf("  thread time: %s\n", shares_text({{"network", fusion.network_s},
                                                    {"vote", fusion.vote_s},
                                                    {"decode", fusion.decode_s},
                                                    {"fuse", fusion.allocate_s + fusion.fuse_s},
                                                    {"mesh and save", report.mesh_s + report.save_s}})
                                           .c_str());
  for (const auto& [reason, count] : fusion.skipped)
    std::printf("  skipped %lld: %s\n", static_cast<long long>(count), reason.c_str());
  if (fusion.labels.invalid > 0)
    std::printf("  %llu observations of probabilities that are no distribution, not fused\n",
                static_cast<unsigned long long>(fusion.labels.invalid));
  for (const char* name : {kMapName, kMeshName, kReportName}) std::printf("  %s\n", (folder / name).c_str());
  const auto applied = std::count_if(touched.begin(), touched.end(),
                                     [](const TouchOutcome& outcome) { return outcome.effect.has_value(); });
  if (applied > 0) std::printf("  %td touches recorded with the sequence\n", applied);
}

/// A few frames projected into each other before the work begins: what is likely wrong. Findings that call for a
/// warning.
std::vector<Finding> likely_faults(const fs::path& sequence, const SequenceOptions& reading) {
  std::vector<Finding> faults;
  try {
    for (Finding& finding : examine_quickly(sequence, reading).findings)
      if (finding.faulty) faults.push_back(std::move(finding));
  } catch (const Error&) {
    // What cannot even be examined is reported where it is read.
  }
  return faults;
}

/// Evidence and touches speak of classes and properties by their place in the tables.
void require_tables_of(const Map& map, const ClassTable& classes, const PropertyTable& properties,
                       const std::string& where) {
  Problems problems;
  problems.expect(map.classes == classes, "--resume", "class table", "that of " + where, "another");
  problems.expect(map.properties == properties, "--resume", "property table", "that of " + where, "another");
  problems.throw_if_any();
}

int run(const ReconstructArguments& arguments, CommonOptions common) {
  const Stopwatch watch;
  const InterruptGuard interrupt;  // from the start: a signal while the sequence opens counts too
  ReconstructOptions options = resolve(arguments, common.threads);
  common.threads = options.threads;
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(common.thread_count()));
  auto sequence = open_sequence(options.sequence, options.reading);
  adopt_sequence_defaults(sequence->info(), options);
  // Loading a network and looking at frames both take a moment, and one thread each.
  auto faults = std::async(
      common.thread_count() > 1 ? std::launch::async : std::launch::deferred,
      [&sequence = options.sequence, &reading = options.reading] { return likely_faults(sequence, reading); });
  const Perception perception = perception_of(options.perception, sequence->info().classes);
  const PreparedClasses classes = prepare_classes(options.labels, perception.classes(sequence->info()));
  const TouchPlan touches = plan_touches(options, *sequence, classes.table);
  prepare_output_folder(options.out);
  const FileLock writing(options.out, FileLock::Kind::exclusive, 1);
  const bool goes_on = options.resume && fs::exists(options.out / kMapName);
  require_no_files(options.out, {kMapName, kMeshName, kReportName}, options.overwrite || goes_on);
  require_writable(options.out / kMapName, options.overwrite);
  check_memory(*sequence, options);
  for (const std::string& note : sequence->info().notes) spdlog::warn("{}", note);
  for (const Finding& fault : faults.get())
    spdlog::warn("{}: {} ({}); mend: {} (feltmap doctor tells more)", fault.topic, fault.belief, fault.evidence,
                 fault.remedy);
  sequence = perceived_sequence(std::move(sequence), perception);

  const nlohmann::ordered_json config = to_json(options);
  const FrameSource source{sequence->info().fingerprint, fusion_settings(config)};
  ReconstructReport report;
  Map map(options.voxel_size_m, options.truncation_m);
  map.classes = classes.table;
  map.properties = touches.properties;
  options.fusion.labels.likelihood = classes.likelihood.get();
  IntegrationScratch scratch;
  bool complete = false;
  std::string touches_done;  // what became of the recorded touches, JSON; empty until they are applied
  if (options.resume)
    if (auto earlier = resume(options.out / kMapName, sequence->info(), config)) {
      require_tables_of(earlier->map, classes.table, touches.properties, (options.out / kMapName).string());
      map = std::move(earlier->map);
      report.fusion = std::move(earlier->record);
      scratch.viewpoints.set_seen(std::move(earlier->viewpoints));
      report.resumed_after = report.fusion.read;
      complete = earlier->complete;
      touches_done = std::move(earlier->touches);
    }
  const bool was_complete = complete;
  const auto save = [&] {
    return save_checkpoint(map, report.fusion, scratch.viewpoints.seen(), complete, touches_done, sequence->info(),
                           config, options.out / kMapName);
  };
  int64_t saved_after = report.resumed_after;  // frames of this run that map.vdb holds
  const auto save_on_the_way = [&] {
    save();
    saved_after = report.fusion.read;
    // A mesh and a report of another map do not lie beside it.
    std::error_code ignored;
    for (const char* name : {kReportName, kMeshName}) fs::remove(options.out / name, ignored);
  };
  fuse(*sequence, source, *perception.times, options, classes.ignored_ids, common, interrupt, save_on_the_way, map,
       scratch, report.fusion);
  // What lies there may be a good map: an empty one does not replace it.
  if (report.fusion.fused == 0 && !report.fusion.stopped.empty()) {
    std::fprintf(stderr, "feltmap: %s before anything was fused: nothing is saved\n", report.fusion.stopped.c_str());
    return kInterrupted;
  }
  if (report.fusion.fused == 0)
    throw FormatError(describe_mismatch(options.sequence.string(), "frames", "at least one that can be fused",
                                        nothing_fused(report.fusion)));

  // An interrupted run may go on: its touches come with its last frame.
  std::vector<TouchOutcome> touched;
  if (report.fusion.stopped.empty() && !complete) {
    const Stopwatch touching;
    touched = apply_touches(map, touches);
    report.touch_s = touching.seconds();
    complete = true;
    if (!touches.file.empty()) touches_done = json_text(touches_json(touches, touched));
  }
  const auto save_at_the_end = [&] {
    try {
      return save();
    } catch (const IoError& fault) {
      if (saved_after == 0 || !fs::exists(options.out / kMapName)) throw;
      throw IoError(fault.what() + ("; the map there is that of the first " + std::to_string(saved_after)) +
                    " frames, and --resume goes on from it");
    }
  };
  write_results(map, save_at_the_end, options.out, common.thread_count(), report);
  describe(map, options, report);
  report.threads = common.thread_count();
  report.total_s = watch.seconds();
  nlohmann::ordered_json document = to_json(report, config);
  if (!touches.file.empty())
    document["touches"] =
        touches_done.empty() ? touches_json(touches, touched) : nlohmann::ordered_json::parse(touches_done);
  const std::string json = json_text(document, 2) + "\n";
  write_file_atomically(options.out / kReportName, json);

  warn_of_losses(report, options, map);
  if (common.json)
    std::fputs(json.c_str(), stdout);
  else if (!common.quiet)
    print_summary(report, touched, options.out);
  print_left_out(touches, touched);
  if (was_complete) warn_if_changed(touches, touches_done);
  const FusionRecord& fusion = report.fusion;
  if (fusion.stopped.empty()) return kDone;
  std::fprintf(stderr,
               "feltmap: %s after %lld of %lld frames: what was fused is saved in %s; --resume goes on from there\n",
               fusion.stopped.c_str(), static_cast<long long>(fusion.read), static_cast<long long>(sequence->size()),
               options.out.c_str());
  return kInterrupted;
}

}  // namespace

void add_reconstruct(CLI::App& app) {
  auto common = std::make_shared<CommonOptions>();
  auto arguments = std::make_shared<ReconstructArguments>();
  CLI::App& command = add_command(app,
                                  {"reconstruct", "Fuse a recorded RGB-D sequence into a map, a mesh and a report",
                                   "feltmap reconstruct recording --out result --voxel-size 0.02\n"
                                   "feltmap reconstruct rgbd_dataset_freiburg1_rpy --out result --frames 0:200:2\n"
                                   "feltmap reconstruct recording --out result --segmenter net.yaml\n"
                                   "feltmap reconstruct recording --out result --checkpoint 100 --resume"},
                                  *common, [arguments, common] { return run(*arguments, *common); });
  add_reconstruct_options(command, *arguments);
}

}  // namespace felt::apps
