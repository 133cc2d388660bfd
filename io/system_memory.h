#pragma once

#include <cstddef>

namespace felt {

/// Bytes that this process can still take: what the system has available, less where a control group or a resource
/// limit allows less. Largest size_t where the system does not tell.
size_t available_memory_bytes();

/// Largest resident size of this process so far, bytes.
size_t peak_resident_bytes();

}  // namespace felt
