#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <string>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/number_checks.h"
#include "apps/options/run_settings.h"
#include "apps/options/touch_options.h"
#include "apps/output/belief_report.h"
#include "apps/output/output_files.h"
#include "core/text.h"
#include "io/files/atomic_file.h"
#include "io/map_file/map_file.h"
#include "io/readings/friction_log.h"

namespace felt::apps {
namespace {

using json = nlohmann::ordered_json;

struct FrictionOptions : CommonOptions {
  std::string log, normal, map, at, plot, touch;
  FrictionSettings settings;
  bool overwrite = false;
};

int run_friction(const FrictionOptions& options) {
  require_ending(options.plot, ".svg");
  require_ending(options.touch, ".csv");
  if (!options.touch.empty()) require_no_file(options.touch, options.overwrite);
  FrictionSettings settings = options.settings;
  std::string normal_from = "assumed: the z axis";
  double normal_sd_rad = 0;
  if (!options.normal.empty()) {
    settings.normal = point_of(options.normal).stableNormalized();
    normal_from = "given";
  }
  if (!options.map.empty()) {
    const Map map = load_map(options.map);
    RegionSettings around;
    around.min_weight = least_observed_weight(map);
    const FittedNormal fitted = surrounding_normal(map, find_contact(map, point_of(options.at), around), around);
    settings.normal = fitted.normal;
    normal_sd_rad = fitted.sd_rad;
    normal_from = "the map's surface around the contact";
  }
  const ForceLog log = read_force_log(options.log);
  FrictionReading reading = friction_reading(log, settings);
  // mu = tan(angle between force and normal): d mu = (1 + mu^2) d angle.
  reading.kinetic_sd =
      std::hypot(reading.kinetic_sd, (1 + reading.kinetic_mean * reading.kinetic_mean) * normal_sd_rad);
  if (!options.plot.empty()) write_plot_svg(options.plot, friction_plots(log, reading));
  const double stamp_s = log.time_s[reading.slide_begin];
  const std::string touch = number_text(stamp_s, "%.6f") + "," + (options.at.empty() ? "x,y,z" : options.at) +
                            ",friction," + number_text(reading.kinetic_mean, "%.4f") + "," +
                            number_text(reading.kinetic_sd, "%.4g");
  const std::string touches = "stamp,x,y,z,property,value,sigma\n" + touch + "\n";
  if (!options.touch.empty()) write_file_atomically(options.touch, touches);
  if (options.json) {
    const auto time = [&](size_t i) { return log.time_s[std::min(i, log.time_s.size() - 1)]; };
    const json out{{"kinetic", {{"mean", reading.kinetic_mean}, {"sd", reading.kinetic_sd}}},
                   {"static", {{"peak", reading.static_peak}, {"time_s", time(reading.peak)}}},
                   {"contact_s", {time(reading.contact_begin), time(reading.contact_end)}},
                   {"sliding_s", {time(reading.slide_begin), time(reading.slide_end)}},
                   {"offset_n", point_json(reading.offset_n)},
                   {"normal", point_json(settings.normal)},
                   {"normal_from", normal_from},
                   {"normal_sd_deg", normal_sd_rad * 180 / std::numbers::pi},
                   {"touch", touch}};
    print_json(out);
    return kDone;
  }
  std::printf("kinetic %.4f +- %.4f, static peak %.4f (contact normal %.3f,%.3f,%.3f, %s)\n", reading.kinetic_mean,
              reading.kinetic_sd, reading.static_peak, settings.normal.x(), settings.normal.y(), settings.normal.z(),
              normal_from.c_str());
  if (const double offset_n = reading.offset_n.norm(); offset_n >= 0.01)
    std::printf("the sensor reads %.2f N without contact: taken off all forces\n", offset_n);
  if (options.at.empty()) std::printf("fill in x,y,z, the contact point in the map, or give --at\n");
  std::printf("%s", touches.c_str());
  return kDone;
}

}  // namespace

void add_friction(CLI::App& app) {
  auto options = std::make_shared<FrictionOptions>();
  CLI::App& command = add_command(app,
                                  {"friction", "Coefficient of friction from a force-torque log",
                                   "feltmap friction log.csv --normal 0,0,1 --plot log.svg\n"
                                   "feltmap friction log.csv --map map.vdb --at 0.4,1.2,0.0 --touch touches.csv"},
                                  *options, [options] { return run_friction(*options); });
  command.add_option("LOG", options->log, "CSV with columns t, fx, fy, fz (seconds, newtons)")->required();
  CLI::Option* normal =
      command.add_option("--normal", options->normal, "Surface normal in the frame of the forces: x,y,z")
          ->check(check_direction);
  CLI::Option* at =
      command.add_option("--at", options->at, "Contact point, metres: x,y,z (for the touch)")->check(check_point);
  command.add_option("--map", options->map, "Take the normal from this map (forces in the world frame)")
      ->needs(at)
      ->excludes(normal);
  command
      .add_option("--cutoff", options->settings.cutoff_hz,
                  "Low-pass cut-off, Hz: -3 dB of each of two passes, forwards and backwards")
      ->check(above_zero())
      ->capture_default_str();
  command.add_option("--contact-force", options->settings.contact_n, "Normal force of a contact, N")
      ->check(above_zero())
      ->capture_default_str();
  command.add_option("--touch", options->touch, "Write the reading as a touches.csv for `feltmap touch --file`")
      ->needs(at);
  command.add_flag("--force", options->overwrite, "Replace the file of --touch where it exists");
  command.add_option("--plot", options->plot, "Write a picture of the log and what was found in it (SVG)");
}

}  // namespace felt::apps
