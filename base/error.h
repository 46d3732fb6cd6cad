#pragma once
// The exceptions of isoshift. Only main() catches them; each type has its exit status (docs/conventions.md).

#include <stdexcept>
#include <string>

namespace isoshift {

// Something that cannot be done with the given input. The message names file and tag, what was found, what was expected
// and what to do next. Exit status 1.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// A command line or an option value that makes no sense. Exit status 2.
class UsageError : public Error {
 public:
  using Error::Error;
};

// A file cannot be written, for example because the disk is full. The same work may succeed later.
class WriteError : public Error {
 public:
  using Error::Error;
};

}  // namespace isoshift
