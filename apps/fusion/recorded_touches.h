#pragma once

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "apps/options/reconstruct_options.h"
#include "io/readings/touches.h"
#include "io/sequence/reader.h"

namespace felt::apps {

/// The touches that were recorded with a sequence, checked before a frame is fused.
struct TouchPlan {
  PropertyTable properties;
  std::filesystem::path file;  ///< empty: there are none
  std::vector<RecordedTouch> touches;
  std::string content;                       ///< of the file, a hash
  int64_t recorded = 0;                      ///< rows of the file
  int64_t left_out = 0;                      ///< recorded before or after the selected frames
  std::string unused;                        ///< why none of them is applied; empty: they are
  std::unique_ptr<SequenceReader> sequence;  ///< every recorded frame, for pixels and stamps
};

/// Reads the property table and the touches that the options name, or that the sequence carries. Throws ConfigError or
/// FormatError, with the first problem, its line, and how many more, for touches that cannot belong to the sequence (a
/// stamp outside it) or that no map of it can hold (an unknown property, a value outside its support). What the
/// sequence merely carries is left unused where there is no property table or no class with a prior.
TouchPlan plan_touches(const ReconstructOptions& options, const SequenceReader& selected, const ClassTable& classes);

/// Applies them to the finished map. A touch whose place cannot be touched leaves the map as it was; one that counts in
/// it already, since an interrupted run was touched by hand, is left out.
std::vector<TouchOutcome> apply_touches(Map& map, const TouchPlan& plan);

/// One line on stderr for every touch that was refused, for those that counted already, and for all of them where they
/// are unused.
void print_left_out(const TouchPlan& plan, const std::vector<TouchOutcome>& outcomes);

/// Says where the file is another one than that of the run whose `touches_json` this is (empty: it had none).
void warn_if_changed(const TouchPlan& plan, const std::string& then);

/// For the report: how many were recorded, applied, counted already and left out, and which were refused, with line and
/// reason.
nlohmann::ordered_json touches_json(const TouchPlan& plan, const std::vector<TouchOutcome>& outcomes);

}  // namespace felt::apps
