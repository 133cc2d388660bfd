#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/segmentation/segment_source.h"
#include "io/sequence/reader.h"
#include "mapping/touch/touch_update.h"

namespace felt {

/// One row of `touches.csv`: when (a stamp or a frame number), where (a world point in metres or a pixel), what.
struct RecordedTouch {
  int line = 0;  ///< in the file, for messages
  std::optional<double> stamp_s;
  std::optional<int64_t> frame;
  std::optional<Eigen::Vector3d> point_m;
  std::optional<Eigen::Vector2d> pixel;  ///< (u, v)
  std::string property;
  double value = 0, sigma = 0;
};

/// Reads a header line that names the columns `stamp` or `frame`, `x,y,z` or `u,v`, `property`, `value` and (may be
/// absent) `sigma`, in any order (where both places have columns, a row gives one and may leave the other empty; the
/// point counts where both are given), and one touch a line; empty lines and lines that start with '#' are skipped.
/// Throws IoError where the file cannot be read and FormatError with the first problem, path:line, and how many more.
std::vector<RecordedTouch> read_touches(const std::filesystem::path& file);
std::vector<RecordedTouch> parse_touches(const std::string& text, const std::string& where);

/// The sequence that touches were recorded with.
struct TouchedSequence {
  std::vector<FrameName> frames;  ///< every recorded frame; not empty
  /// The frame at a place of `frames`; nothing where it cannot be read.
  std::function<std::optional<Frame>(size_t)> read;
  /// What the region rule `mask` takes a touch's region from, where it is given by frame and pixel.
  SegmentSource segments = SegmentSource::geometric;
};
/// `reader` must outlive what is returned.
TouchedSequence touched_sequence(const SequenceReader& reader);

/// When a touch was recorded, seconds: its stamp, or that of its frame. Throws TouchError where it is not within the
/// sequence.
double stamp_of(const RecordedTouch& touch, const TouchedSequence& sequence);

/// Whether both say the same of the same place and time, however it is to be understood.
bool same_reading(const TouchRequest& a, const TouchRequest& b);

/// What is done about readings that count in the map already.
enum class KnownReadings { apply_again, leave_out };

/// What became of one recorded touch.
struct TouchOutcome {
  RecordedTouch touch;
  std::optional<TouchEffect> effect;
  std::string refused;           ///< why there is no effect; empty for what counts already
  bool already_counted = false;  ///< left out: the map had this reading
};

/// Applies recorded touches to a map at their stamps. Touch state is a function of vision counts and journal, so they
/// are all applied when the frames are fused: each region is then found in the complete map, and it makes no difference
/// when in the sequence a touch came. `defaults` gives what a row does not say (model, region settings, ...); without a
/// `sequence` a row needs a point, and a frame number, which must be among the map's, stands for its stamp. With the
/// region rule `mask` the region of a touch given by frame and pixel is the frame's segment under that pixel. A touch
/// that cannot be applied leaves the map as it was and says why; the others count. With `KnownReadings::leave_out` each
/// touch that counted in the map before stands for one row of the same reading, which is not applied.
std::vector<TouchOutcome> apply_recorded_touches(Map& map, const std::vector<RecordedTouch>& touches,
                                                 const TouchRequest& defaults, const TouchedSequence* sequence,
                                                 KnownReadings known = KnownReadings::apply_again);

}  // namespace felt
