#pragma once

namespace felt::apps {

/// What the process returns; scripts may rely on the numbers.
enum ExitCode : int {
  kDone = 0,
  kDifferent = 1,      ///< compared and different, or found faulty
  kUsage = 2,          ///< the command line
  kConfiguration = 3,  ///< a setting that cannot be used (ConfigError)
  kInputOutput = 4,    ///< a file that cannot be read or written, or that holds something else (IoError, FormatError)
  kInterrupted = 5,    ///< stopped by a signal; what was done is saved
  kInternal = 70,      ///< a fault of the program
};

}  // namespace felt::apps
