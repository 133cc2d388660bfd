#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "core/class_table.h"
#include "core/frame.h"

namespace felt {

/// A frame that cannot be fused, as data: the report counts them by reason.
struct SkippedFrame {
  int64_t index = 0;
  std::string reason;  ///< short and countable, for example "missing pose", "truncated depth image"
  std::string detail;  ///< the file and what was found
};

using ReadResult = std::variant<Frame, SkippedFrame>;

/// Which frame of the recording stands at a position of the selection.
struct FrameName {
  int64_t index = 0;   ///< frame number
  double stamp_s = 0;  ///< recorded time, or the index where none is recorded
};

/// What is known of a sequence before its first frame is decoded.
struct SequenceInfo {
  std::string layout;          ///< "7scenes", "tum", ...
  std::filesystem::path path;  ///< as opened
  PinholeCamera camera;        ///< of the depth images
  double depth_scale = 0;      ///< stored depth units per metre
  std::string pose_convention;
  bool has_color = false, has_labels = false, has_probabilities = false, has_instances = false;
  int probability_ranks = 1;                            ///< most classes that a pixel has probabilities of
  ClassTable classes;                                   ///< empty where the sequence brings none
  std::filesystem::path properties_file, touches_file;  ///< that the sequence carries; empty where it has none
  int64_t recorded_frames = 0;                          ///< before the selection of frames
  /// Which recording it is (io/sequence/sequence_fingerprint.h), wherever it lies and whatever of it is selected, also
  /// after it grew.
  std::string fingerprint;
  std::string content;  ///< of all its frames: another one after it grew or changed
  /// How its files are understood (camera, depth scale, convention of the poses, ...) and which label images it has, as
  /// text by name: the same where the same frames would be read.
  std::map<std::string, std::string> reading;
  double voxel_size_m = 0, max_depth_m = 0;  ///< what suits the sensor; 0: nothing else than usual
  std::vector<std::string> notes;            ///< what was assumed or repaired, one sentence each
};

/// A recorded sequence. Opening reads what is small (poses, file names, stamps, camera); `read` decodes one frame and
/// may be called from several threads at once, which is how decoding runs ahead of fusion.
class SequenceReader {
public:
  virtual ~SequenceReader() = default;
  virtual const SequenceInfo& info() const = 0;
  /// Number of selected frames.
  virtual int64_t size() const = 0;
  /// Number and stamp of the frame at a position, without decoding it.
  virtual FrameName name(int64_t i) const = 0;
  /// Frame at position 0 <= i < size() in recorded order. Never throws for a bad frame.
  virtual ReadResult read(int64_t i) const = 0;
};

}  // namespace felt
