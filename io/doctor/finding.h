#pragma once

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

/// A number as a person would write it: "%.3g" unless another format is given.
std::string number_text(double value, const char* format = "%.3g");

}  // namespace felt
