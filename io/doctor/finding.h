#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace felt {

/// What the doctor believes about one topic.
struct Finding {
  std::string topic;      ///< "pose-convention", "depth-scale", ...: docs/doctor.md lists them
  bool faulty = false;    ///< the sequence as read now contradicts the belief
  double confidence = 0;  ///< in [0, 1] that the belief is right
  std::string belief;     ///< one sentence
  std::string evidence;   ///< what was measured
  std::string remedy;     ///< the option that mends it, or what to do; empty where nothing is wrong
};

/// A share of 1 in per cent: "0.26 %", "4.1 %", "100 %".
std::string percent_text(double share);

/// Frame numbers: "3, 4, 9 and 12 more".
std::string frames_text(const std::vector<int64_t>& numbers);

/// The option that states a camera: "--intrinsics fx,fy,cx,cy", pixels.
std::string intrinsics_option(double fx, double fy, double cx, double cy);

}  // namespace felt
