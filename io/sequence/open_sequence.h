#pragma once

#include <filesystem>
#include <memory>

#include "io/sequence/reader.h"
#include "io/sequence/sequence_listing.h"
#include "io/sequence/sequence_options.h"

namespace felt {

/// Throws ConfigError where `name` is not one that `SequenceOptions::format` may be.
void require_layout(const std::string& name);

/// What the layout of `path` finds, with the user's options applied: names, poses and camera as plain data, nothing
/// decoded. All recorded frames, before any selection. Throws as `open_sequence` does.
SequenceListing list_sequence(const std::filesystem::path& path, const SequenceOptions& options = {});

/// Opens a recorded sequence: detects its layout (or takes `options.format`), reads poses, names and camera, and checks
/// that they belong together. Nothing is decoded but the header of the first depth image.
///
/// Throws ConfigError for an unknown format or an empty selection, IoError where the folder cannot be read, FormatError
/// where no layout fits (the message lists what was looked for) or the camera cannot be that of the images.
std::unique_ptr<SequenceReader> open_sequence(const std::filesystem::path& path, const SequenceOptions& options = {});

}  // namespace felt
