#include "io/images/depth_decode.h"

#include "io/images/exr_decode.h"
#include "io/images/image_decode.h"
#include "io/images/npy_decode.h"
#include "io/images/tiff_decode.h"

namespace felt {

StoredDepth decode_depth(std::span<const uint8_t> file, const std::string& where) {
  const ImageHeader header = read_image_header(file, where);  // refuses gigapixels
  switch (header.format) {
    case ImageFormat::tiff:
      return decode_tiff(file, where);
    case ImageFormat::exr:
      return decode_exr(file, where);
    case ImageFormat::npy:
      return decode_npy(file, where);
    default:
      return decode_gray16(file, where);
  }
}

}  // namespace felt
