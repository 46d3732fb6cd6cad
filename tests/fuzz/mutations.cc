// Reads damaged copies of every kind of file isoshift reads (DicomMutator). Every one must be read or refused with
// Error, within 10 s. Prints what came of them; exits with 1 at the first that did anything else.
//
//   mutations [count=12000] [first seed=1]

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string_view>

#include "base/error.h"
#include "base/text_file.h"
#include "io/dicom/decoder_process.h"
#include "tests/fuzz/dicom_mutator.h"
#include "tests/fuzz/readers.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/testdata.h"

namespace isoshift {
namespace {

struct Original {
  std::string reader;
  std::string name;
  std::string bytes;
};

std::vector<Original> originals() {
  std::vector<Original> list;
  const auto add = [&](const std::string& reader, const std::string& file) {
    list.push_back({reader, file, text_of_file(testdata(file))});
  };
  add("ct", "small/1/CT/CT0018.dcm");
  for (const char* name : {"jpeg-ls", "jpeg-lossless", "jpeg2000", "rle", "deflated", "implicit", "big-endian"})
    add("ct", fmt::format("compressed/{}.dcm", name));
  add("rt_image", "small/1/RTIMAGE/KV_G090.dcm");
  add("rt_plan", "small/1/RTPLAN.dcm");
  add("rt_structures", "thorax/RTSTRUCT.dcm");
  add("spatial_registration", "registrations/HFS/spatial_registration.dcm");
  add("rt_image", "rt-images/obi-frames/KV.dcm");
  return list;
}

double used_mb(int whose) {
  rusage used{};
  ::getrusage(whose, &used);
  return static_cast<double>(used.ru_maxrss) / 1024.0;
}

int run(std::uint64_t count, std::uint64_t first_seed) {
  const TemporaryFolder folder(memory_folder());
  const std::filesystem::path path = folder / "mutated.dcm";
  std::uint64_t read = 0, refused = 0, died = 0, stalled = 0, slow = 0;
  double slowest_s = 0.0;
  const std::vector<Original> list = originals();
  for (std::uint64_t seed = first_seed; seed < first_seed + count; ++seed) {
    const Original& original = list[seed % list.size()];
    std::ofstream(path, std::ios::binary) << DicomMutator(seed).mutated(original.bytes);
    const auto start = std::chrono::steady_clock::now();
    try {
      kReaders.at(original.reader)(path);
      ++read;
    } catch (const Error& error) {
      ++refused;
      const std::string_view message = error.what();
      died += message.find("the decoder ended with") != message.npos ? 1 : 0;
      stalled += message.find("were not decoded within") != message.npos ? 1 : 0;
    } catch (const std::exception& error) {
      std::cerr << fmt::format("seed {} ({}): {}\n", seed, original.name, error.what());
      return 1;
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    slowest_s = std::max(slowest_s, seconds);
    if (seconds <= 2.0) continue;
    ++slow;
    std::cerr << fmt::format("seed {} ({}) took {:.1f} s\n", seed, original.name, seconds);
    if (seconds > 11.0) return 1;
  }
  use_decoder({});  // ends those that wait, so that their memory is known
  std::cout << fmt::format(
      "{} files, seeds {} to {}: {} read, {} refused, of these {} by a decoder that died and {} by one that was ended; "
      "{} took longer than 2 s, the slowest {:.2f} s; at most {:.0f} MB of memory, decoders {:.0f} MB\n",
      count, first_seed, first_seed + count - 1, read, refused, died, stalled, slow, slowest_s, used_mb(RUSAGE_SELF),
      used_mb(RUSAGE_CHILDREN));
  return 0;
}

}  // namespace
}  // namespace isoshift

int main(int argc, char** argv) {
  // Decodes as its own child, as the program does (cli/main.cc).
  if (argc == 3 && argv[1] == std::string_view("__child")) return isoshift::run_decoder();
  isoshift::use_decoder("/proc/self/exe");
  return isoshift::run(argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 12000,
                       argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1);
}
