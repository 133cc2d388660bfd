#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace felt {

/// Base of every error that a user can cause. The message is one line: what failed, where (path:line or key), what was
/// expected and what was found. Programmer errors are assertions, and a bad frame of a sequence is data
/// (io/sequence/reader.h).
class Error : public std::runtime_error {
public:
  using std::runtime_error::runtime_error;
};

/// A setting that cannot be used. Carries every problem found at once, one a line.
class ConfigError : public Error {
public:
  using Error::Error;
  explicit ConfigError(const std::vector<std::string>& problems);
};

/// A file or directory that cannot be opened, read or written.
class IoError : public Error {
public:
  using Error::Error;
};

/// A file that can be read but does not hold what it should.
class FormatError : public Error {
public:
  using Error::Error;
};

/// "<where>: <what>: expected <expected>, found <found>".
std::string describe_mismatch(const std::string& where, const std::string& what, const std::string& expected,
                              const std::string& found);

}  // namespace felt
