#include "io/files/content_hash.h"

#include <xxhash.h>

#include <new>

#include "core/text.h"

namespace felt {

struct ContentHash::State {
  std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> xxh3{XXH3_createState(), &XXH3_freeState};
};

ContentHash::ContentHash() : state_(std::make_unique<State>()) {
  if (state_->xxh3 == nullptr) throw std::bad_alloc();
  XXH3_128bits_reset(state_->xxh3.get());
}

ContentHash::~ContentHash() = default;

void ContentHash::add(std::string_view bytes) { XXH3_128bits_update(state_->xxh3.get(), bytes.data(), bytes.size()); }

std::string ContentHash::digits() const {
  const XXH128_hash_t hash = XXH3_128bits_digest(state_->xxh3.get());
  return hexadecimal(hash.high64) + hexadecimal(hash.low64);
}

std::string content_hash(std::string_view bytes) {
  ContentHash hash;
  hash.add(bytes);
  return hash.digits();
}

}  // namespace felt
