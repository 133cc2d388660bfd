#include "apps/output/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace felt::apps {
namespace {

int terminal_columns() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

std::string clock_text(double seconds) {
  const auto s = int64_t(std::ceil(seconds));
  char text[32];
  if (s < 3600) {
    std::snprintf(text, sizeof text, "%d:%02d", int(s / 60), int(s % 60));
  } else {
    std::snprintf(text, sizeof text, "%lld:%02d:%02d", static_cast<long long>(s / 3600), int(s / 60 % 60), int(s % 60));
  }
  return text;
}

}  // namespace

std::string progress_line(const std::string& unit, int64_t done, int64_t total, double elapsed_s, int width,
                          const std::string& note) {
  const double rate = elapsed_s > 0 ? double(done) / elapsed_s : 0;
  char numbers[128];
  std::snprintf(numbers, sizeof numbers, "%lld/%lld %s  %.*f %s/s", static_cast<long long>(done),
                static_cast<long long>(total), unit.c_str(), rate < 100 ? 1 : 0, rate, unit.c_str());
  std::string text = numbers;
  if (rate > 0 && done < total) text += "  " + clock_text(double(total - done) / rate) + " left";
  if (!note.empty()) text += "  " + note;
  const int bar = std::min(40, width - int(text.size()) - 3);
  if (bar >= 5) {
    const double part = total > 0 ? std::clamp(double(done) / double(total), 0.0, 1.0) : 1.0;
    const int full = int(part * bar);
    text = "[" + std::string(size_t(full), '#') + std::string(size_t(bar - full), '.') + "] " + text;
  }
  if (int(text.size()) > width) text.resize(size_t(std::max(width, 0)));
  return text;
}

std::string shares_text(const std::vector<std::pair<std::string, double>>& seconds) {
  double sum = 0;
  for (const auto& [name, spent] : seconds) sum += std::max(0.0, spent);
  std::string text;
  for (const auto& [name, spent] : seconds)
    if (sum > 0 && spent > 0.005 * sum)
      text += (text.empty() ? "" : ", ") + name + " " + std::to_string(std::lround(100 * spent / sum)) + " %";
  return text;
}

ProgressBar::ProgressBar(std::string unit, int64_t total, bool enabled)
    : unit_(std::move(unit)), total_(total), visible_(enabled && isatty(STDERR_FILENO) && isatty(STDOUT_FILENO)) {}

ProgressBar::~ProgressBar() {
  if (visible_) std::fputs("\r\x1b[K", stderr);
}

void ProgressBar::update(int64_t done, const std::string& note) {
  if (!visible_) return;
  const auto now = Clock::now();
  if (done < total_ && now - drawn_ < std::chrono::milliseconds(100)) return;
  drawn_ = now;
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  // One column less than the terminal has: a full line would wrap.
  const std::string line = progress_line(unit_, done, total_, elapsed_s, terminal_columns() - 1, note);
  std::fprintf(stderr, "\r\x1b[K%s", line.c_str());
}

}  // namespace felt::apps
