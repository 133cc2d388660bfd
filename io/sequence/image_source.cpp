#include "io/sequence/image_source.h"

#include <fstream>

#include "core/error.h"
#include "io/files/text_input.h"

namespace felt {
namespace {
constexpr size_t kImageFileLimitBytes = size_t(1) << 28;
}

std::string read_source(const ImageSource& source, const std::string& kind) {
  std::error_code fault;
  if (source.empty() || !std::filesystem::exists(source.path, fault))
    throw SkipFrame{"missing " + kind + " image", source.empty() ? "no file" : source.path.string()};
  if (source.bytes == 0) {
    try {
      return read_whole_file(source.path, kImageFileLimitBytes);
    } catch (const Error& problem) {
      throw SkipFrame{"unreadable " + kind + " image", problem.what()};
    }
  }
  if (source.bytes > kImageFileLimitBytes)
    throw SkipFrame{"too large " + kind + " image",
                    source.path.string() + ": " + std::to_string(source.bytes) + " bytes"};
  std::ifstream file(source.path, std::ios::binary);
  std::string bytes(source.bytes, '\0');
  if (!file.seekg(std::streamoff(source.offset)) || !file.read(bytes.data(), std::streamsize(bytes.size())))
    throw SkipFrame{"truncated " + kind + " image", source.path.string() + " at byte " + std::to_string(source.offset)};
  return bytes;
}

}  // namespace felt
