#pragma once

#include <cstddef>
#include <cstdint>

namespace felt {

// Filters of PNG rows (PNG specification, section 9), undone in place. A row is its filtered bytes without the byte
// that names the filter; `above` is the row above, already unfiltered, zeros for the first.

/// Adds the prediction of `filter` (1 to 4) to each byte of a row, from byte `from` on, a pixel's first. `pixel_bytes`:
/// 1, 2, 3, 4, 6 or 8.
void unfilter_row(int filter, uint8_t* row, const uint8_t* above, size_t bytes, int pixel_bytes, size_t from = 0);

/// Rows of Paeth's filter that `unfilter_paeth_rows` takes at once.
inline constexpr int kPaethRows = 4;

/// The same for 2 to kPaethRows consecutive rows of filter 4, `stride` bytes apart, with the row above the first
/// `stride` bytes before it. Each pixel waits for the one to its left, so a row alone is bound by latency; here row r
/// is r pixels behind and a vector holds a pixel of every row. `pixel_bytes`: 2, 3 or 4. Reads, and leaves as it is,
/// one byte behind each row. Every target gives the bytes of `unfilter_row`.
void unfilter_paeth_rows(uint8_t* rows, size_t stride, int count, size_t bytes, int pixel_bytes);

}  // namespace felt
