#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace felt {

/// What a user says about the fusion of labels, on the command line or in a configuration file. What is left out is
/// empty.
struct LabelSettings {
  std::optional<double> band_vox;      ///< voxels on either side of the surface that take labels
  std::optional<double> evidence;      ///< what one observation adds
  std::optional<double> max_evidence;  ///< cap of a voxel's evidence; 0: none
  std::optional<double> novelty_m;     ///< camera travel that makes a view count in full; 0: every view
  std::optional<double> novelty_deg;
  std::optional<double> class_prior;           ///< concentration of every class before anything was seen
  std::filesystem::path confusion;             ///< what the network mistakes for what (io/tables/confusion_file.h)
  std::vector<std::string> ignore_classes;     ///< names: neither labels nor surface
  std::optional<bool> instances, spread_rest;  ///< keep instance ids; dropped mass of top-m goes to the other classes
};

/// `first` where it says something, else `second`.
LabelSettings overlaid(LabelSettings first, const LabelSettings& second);

/// Every number that cannot be used, one message each, with the names of command-line options.
std::vector<std::string> problems_of(const LabelSettings& settings);

}  // namespace felt
