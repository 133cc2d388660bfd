#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "io/sequence/sequence_listing.h"

namespace felt {

/// One way to store a sequence. Adding one is a file in io/sequence/layouts/ and a line in `all_layouts`.
struct Layout {
  const char* name;
  const char* looks_for;  ///< the files that mark it, for the message when nothing is recognised
  bool (*recognises)(const std::filesystem::path& path);
  /// Throws IoError or FormatError where the sequence as a whole cannot be used.
  SequenceListing (*list)(const std::filesystem::path& path, const SequenceOptions& options);
};

/// In the order in which detection asks them.
std::span<const Layout> all_layouts();

extern const Layout kSevenScenesLayout, kTumLayout, kReplicaLayout, kGenericLayout, kRedwoodLayout, kScanNetLayout,
    kSensLayout, kIclLayout, kSceneNetLayout, kApcLayout, kLidarLayout;

}  // namespace felt
