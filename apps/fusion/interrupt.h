#pragma once

namespace felt::apps {

/// From construction to destruction SIGINT, SIGTERM and (unless ignored, as under nohup) SIGHUP set a flag instead of
/// ending the process, so that a command can save what it has. A second signal ends the process at once. One object at
/// a time.
class InterruptGuard {
public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  bool requested() const;
};

}  // namespace felt::apps
