// A libFuzzer target: one reader, chosen when it is built (ISOSHIFT_READER), on whatever bytes the fuzzer invents. They
// are read from a file in memory. ./dev fuzz builds and runs one per reader.

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>

#include "base/error.h"
#include "tests/fuzz/dicom_mutator.h"
#include "tests/fuzz/readers.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

// Half of all changes are of elements, items and sequences; the fuzzer's own know bytes only.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  if (seed % 2 == 0) return LLVMFuzzerMutate(data, size, max_size);
  const std::string changed =
      isoshift::DicomMutator(seed).with_mutated_elements({reinterpret_cast<const char*>(data), size});
  if (changed.size() > max_size) return LLVMFuzzerMutate(data, size, max_size);
  std::ranges::copy(changed, data);
  return changed.size();
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const int memory = ::memfd_create("fuzzed", 0);
  static const std::filesystem::path path = fmt::format("/proc/self/fd/{}", memory);
  if (::ftruncate(memory, 0) != 0 || ::pwrite(memory, data, size, 0) != static_cast<ssize_t>(size)) return 0;
  try {
    isoshift::kReaders.at(ISOSHIFT_READER)(path);
  } catch (const isoshift::Error&) {
  }
  return 0;
}
