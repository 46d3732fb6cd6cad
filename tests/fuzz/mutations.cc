// Reads damaged copies of every kind of file isoshift reads (DicomMutator), or the files that fuzzing has left in the
// folders ct, enhanced_ct, ... of FOLDER. Every one must be read or refused with Error, within 10 s. Prints what came
// of them; exits with 1 at the first that did anything else.
//
//   mutations [count=12000] [first seed=1]
//   mutations FOLDER

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <ranges>
#include <string_view>

#include "base/error.h"
#include "base/stopwatch.h"
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
  add("enhanced_ct", "enhanced/plain.dcm");
  add("enhanced_ct", "enhanced/rle.dcm");
  return list;
}

double used_mb(int whose) {
  rusage used{};
  ::getrusage(whose, &used);
  return static_cast<double>(used.ru_maxrss) / 1024.0;
}

// What came of the files that were read.
class Outcomes {
 public:
  // Whether the file was read or refused in time; if not, says so.
  bool read(const std::string& reader, const std::filesystem::path& path, const std::string& name) {
    const Stopwatch watch;
    try {
      kReaders.at(reader)(path);
      ++read_;
    } catch (const Error& error) {
      ++refused_;
      const std::string_view message = error.what();
      died_ += message.find("the decoder ended with") != message.npos ? 1 : 0;
      stalled_ += message.find("were not decoded within") != message.npos ? 1 : 0;
    } catch (const std::exception& error) {
      std::cerr << fmt::format("{}: {}\n", name, error.what());
      return false;
    }
    const double seconds = watch.seconds();
    slowest_s_ = std::max(slowest_s_, seconds);
    if (seconds <= 2.0) return true;
    ++slow_;
    std::cerr << fmt::format("{} took {:.1f} s\n", name, seconds);
    return seconds <= 11.0;
  }

  void print() const {
    use_decoder({});  // ends those that wait, so that their memory is known
    std::cout << fmt::format(
        "{} files: {} read, {} refused, of these {} by a decoder that died and {} by one that was ended; {} took "
        "longer than 2 s, the slowest {:.2f} s; at most {:.0f} MB of memory, decoders {:.0f} MB\n",
        read_ + refused_, read_, refused_, died_, stalled_, slow_, slowest_s_, used_mb(RUSAGE_SELF),
        used_mb(RUSAGE_CHILDREN));
  }

 private:
  std::uint64_t read_ = 0, refused_ = 0, died_ = 0, stalled_ = 0, slow_ = 0;
  double slowest_s_ = 0.0;
};

int read_mutations(std::uint64_t count, std::uint64_t first_seed) {
  const TemporaryFolder folder(memory_folder());
  const std::filesystem::path path = folder / "mutated.dcm";
  Outcomes outcomes;
  const std::vector<Original> list = originals();
  for (std::uint64_t seed = first_seed; seed < first_seed + count; ++seed) {
    const Original& original = list[seed % list.size()];
    std::ofstream(path, std::ios::binary) << DicomMutator(seed).mutated(original.bytes);
    if (!outcomes.read(original.reader, path, fmt::format("seed {} ({})", seed, original.name))) return 1;
  }
  outcomes.print();
  return 0;
}

int read_kept(const std::filesystem::path& folder) {
  Outcomes outcomes;
  for (const auto& reader : std::views::keys(kReaders))
    for (const auto& file : std::filesystem::directory_iterator(folder / reader))
      if (!outcomes.read(reader, file.path(), file.path().string())) return 1;
  outcomes.print();
  return 0;
}

}  // namespace
}  // namespace isoshift

int main(int argc, char** argv) {
  // It is its own decoder, which is started without arguments.
  if (argc == 1) return isoshift::run_decoder();
  isoshift::use_decoder("/proc/self/exe");
  if (argc == 2 && std::filesystem::is_directory(argv[1])) return isoshift::read_kept(argv[1]);
  return isoshift::read_mutations(std::strtoull(argv[1], nullptr, 10),
                                  argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1);
}
