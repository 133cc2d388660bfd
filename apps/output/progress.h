#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace felt::apps {

/// "[#####.....] 120/700 frames  85.3 frames/s  0:06 left  note", at most `width` columns; the bar takes what is over.
std::string progress_line(const std::string& unit, int64_t done, int64_t total, double elapsed_s, int width,
                          const std::string& note = {});

/// Where time went: "network 84 %, decode 11 %", the parts above half a percent of their sum in the order given.
std::string shares_text(const std::vector<std::pair<std::string, double>>& seconds);

/// A progress bar on stderr with rate and time left; silent where `enabled` is false or where stdout or stderr is not a
/// terminal. Erases itself when destroyed.
class ProgressBar {
public:
  ProgressBar(std::string unit, int64_t total, bool enabled);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// Redraws at most ten times a second, `note` behind the numbers.
  void update(int64_t done, const std::string& note = {});

private:
  using Clock = std::chrono::steady_clock;
  std::string unit_;
  int64_t total_;
  bool visible_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point drawn_;
};

}  // namespace felt::apps
