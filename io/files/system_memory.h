#pragma once

#include <cstddef>

namespace felt {

/// Bytes that this process can still take: what the system has available, less where a control group or a resource
/// limit allows less. Largest size_t where the system does not tell.
size_t available_memory_bytes();

/// Largest resident size of this process so far, bytes.
size_t peak_resident_bytes();

/// Keeps freed memory for the next image instead of giving it back to the system (where the C library is glibc): page
/// faults of frames that come and go otherwise take a third of a run. At most 256 MiB stay. For programs, at their
/// start.
void keep_freed_memory();

}  // namespace felt
