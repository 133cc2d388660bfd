#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace felt {

/// Names a content by XXH3, 128 bits, as 32 hexadecimal digits; the content may come in parts.
class ContentHash {
public:
  ContentHash();
  ~ContentHash();
  void add(std::string_view bytes);
  /// Of what was added so far.
  std::string digits() const;

private:
  struct State;
  std::unique_ptr<State> state_;
};

std::string content_hash(std::string_view bytes);

}  // namespace felt
