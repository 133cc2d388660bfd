#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace felt::apps {

/// "[#####.....] 120/700 frames  85.3 frames/s  0:06 left", at most `width` columns; the bar takes what is over.
std::string progress_line(const std::string& unit, int64_t done, int64_t total, double elapsed_s, int width);

/// A progress bar on stderr with rate and time left; silent where `enabled` is false or where stdout or stderr is not a
/// terminal. Erases itself when destroyed.
class ProgressBar {
public:
  ProgressBar(std::string unit, int64_t total, bool enabled);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// Redraws at most ten times a second.
  void update(int64_t done);

private:
  using Clock = std::chrono::steady_clock;
  std::string unit_;
  int64_t total_;
  bool visible_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point drawn_;
};

}  // namespace felt::apps
