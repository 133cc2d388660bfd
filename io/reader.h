#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <variant>

#include "core/frame.h"

namespace felt {

/// A frame that cannot be fused, as data: the report counts them by reason.
struct SkippedFrame {
  int64_t index = 0;
  std::string reason;  ///< short and countable, for example "missing pose", "truncated depth image"
  std::string detail;  ///< the file and what was found
};

using ReadResult = std::variant<Frame, SkippedFrame>;

/// A recorded sequence. Opening reads what is small (poses, file names, stamps, camera); `read` decodes one frame and
/// may be called from several threads at once, which is how decoding runs ahead of fusion.
class SequenceReader {
public:
  virtual ~SequenceReader() = default;
  virtual int64_t size() const = 0;
  /// Frame at position 0 <= i < size() in recorded order. Never throws for a bad frame.
  virtual ReadResult read(int64_t i) const = 0;
};

}  // namespace felt
