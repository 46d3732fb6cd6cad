#pragma once
// Damages DICOM files in the units they are made of: elements, items and sequences; and in bytes, as a broken disk
// would.

#include <cstdint>
#include <random>
#include <string>

namespace isoshift {

class DicomMutator {
 public:
  explicit DicomMutator(std::uint64_t seed) : random_(seed) {}

  // The file with one to three changes. What is no DICOM file is changed in its bytes only.
  std::string mutated(std::string file);
  // With changes of elements only: values, elements and items that another program could have written.
  std::string with_mutated_elements(std::string file);

 private:
  std::size_t below(std::size_t count) { return std::uniform_int_distribution<std::size_t>(0, count - 1)(random_); }
  std::size_t place(const std::string& bytes);
  void change_bytes(std::string& bytes);
  bool change_elements(std::string& bytes);

  std::mt19937_64 random_;
};

}  // namespace isoshift
