#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "io/pictures/plot_svg.h"

namespace felt {

/// A force-torque log: time in seconds, force in newtons in the frame of the contact normal.
struct ForceLog {
  std::vector<double> time_s;
  std::vector<Eigen::Vector3d> force_n;
};

/// Reads a CSV with a header that names `t` (or `time`, `stamp`), `fx`, `fy`, `fz`; other columns are ignored. Throws
/// IoError and FormatError: missing columns, cells that are no finite number, times that do not grow, fewer than 16
/// samples; the first problem with path:line, and how many more.
ForceLog read_force_log(const std::filesystem::path& file);
ForceLog parse_force_log(const std::string& text, const std::string& where);

struct FrictionSettings {
  Eigen::Vector3d normal{0, 0, 1};  ///< of the surface, any length, frame of the forces
  double cutoff_hz = 10;            ///< of the low-pass, -3 dB of one pass
  double contact_n = 1;             ///< normal force from which there is contact
};

/// What a log says about friction.
struct FrictionReading {
  double static_peak = 0;                             ///< largest F_t/F_n before sliding
  double kinetic_mean = 0;                            ///< mean of F_t/F_n while sliding
  double kinetic_sd = 0;                              ///< standard deviation of the same
  Eigen::Vector3d offset_n{0, 0, 0};                  ///< what the sensor reads without contact, taken off all forces
  size_t contact_begin = 0, contact_end = 0;          ///< samples [begin, end) of the longest contact
  size_t peak = 0;                                    ///< sample of the static peak
  size_t slide_begin = 0, slide_end = 0;              ///< samples of the kinetic plateau
  std::vector<double> normal_n, tangential_n, ratio;  ///< filtered; ratio is NaN out of contact
};

/// Zero-phase low-pass (Butterworth of order 2, forwards and backwards: squared gain, no delay) of samples that are
/// `rate_hz` apart. Ends are extended by odd reflection. `cutoff_hz` below half the rate.
std::vector<double> low_pass_zero_phase(const std::vector<double>& samples, double rate_hz, double cutoff_hz);

/// Low-pass; what the sensor reads without contact taken off (where the log shows it); normal and tangential force by
/// projection on the normal; longest contact with F_n >= contact_n, of which the ratio counts where F_n is at least
/// half its median; kinetic plateau (the longest run within a tenth, or three robust deviations up to a quarter, of the
/// ratio that most of the loaded contact keeps, at least a twentieth of the contact long); static peak (the highest
/// ratio before it). Throws ConfigError for a normal or setting that is no number in range, and FormatError where there
/// is no contact, no normal force, or no sliding: no run, one that rises all along as a load on a foot that sticks
/// does, or a tangential force that the sensor's noise explains.
FrictionReading friction_reading(const ForceLog& log, const FrictionSettings& settings);

/// Forces and their ratio over time with contact, peak and plateau marked.
std::vector<Plot> friction_plots(const ForceLog& log, const FrictionReading& reading);

}  // namespace felt
