#include "tests/fuzz/dicom_mutator.h"

#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dctk.h>

#include <algorithm>
#include <vector>

namespace isoshift {
namespace {

// An element and the item, or dataset, that holds it.
struct Place {
  DcmItem* item;
  DcmElement* element;
};

void collect(DcmItem& item, std::vector<Place>& places, std::vector<DcmSequenceOfItems*>& sequences) {
  for (unsigned long n = 0; n < item.card(); ++n) {
    DcmElement* element = item.getElement(n);
    places.push_back({&item, element});
    auto* sequence = element->ident() == EVR_SQ ? dynamic_cast<DcmSequenceOfItems*>(element) : nullptr;
    if (sequence == nullptr) continue;
    sequences.push_back(sequence);
    for (unsigned long k = 0; k < sequence->card(); ++k) collect(*sequence->getItem(k), places, sequences);
  }
}

bool is_number(DcmEVR vr) { return vr == EVR_DS || vr == EVR_IS; }

const std::vector<const char*> kNumbers = {"",
                                           "0",
                                           "-0",
                                           "-1",
                                           "1",
                                           "2",
                                           "0.5",
                                           "1e308",
                                           "-1e308",
                                           "1e-320",
                                           "nan",
                                           "inf",
                                           "1e9",
                                           "360",
                                           "359.999",
                                           "-180",
                                           "99999999999",
                                           "0x10",
                                           "1,5",
                                           " 7 ",
                                           "1\\2",
                                           "\\",
                                           "1\\2\\3\\4\\5\\6",
                                           "512",
                                           "65536"};
const std::vector<const char*> kTexts = {"",
                                         " ",
                                         "\\",
                                         "A",
                                         "\xE9\xFF",
                                         "../../x",
                                         "/dev/zero",
                                         "1.2.3",
                                         "2.25.1",
                                         "1.2.840.10008.1.2.4.90",
                                         "20260301",
                                         "2026.03.01",
                                         "10:59:00",
                                         "246060",
                                         "HFS",
                                         "FFDL",
                                         "MONOCHROME1",
                                         "PALETTE COLOR",
                                         "LOG",
                                         "DISP",
                                         "MM",
                                         "M",
                                         "DRR\\DRR",
                                         "ORIGINAL\\PRIMARY\\BLANK",
                                         "{}",
                                         "\x1B[2J",
                                         "%s%n",
                                         "\n"};

// The bytes of a file, in the transfer syntax that it has; empty where DCMTK does not write it.
std::string written(DcmFileFormat& file, E_TransferSyntax syntax) {
  std::vector<char> buffer(std::size_t{1} << 20);
  DcmOutputBufferStream stream(buffer.data(), static_cast<offile_off_t>(buffer.size()));
  std::string bytes;
  OFCondition state = EC_StreamNotifyClient;
  file.transferInit();
  while (state == EC_StreamNotifyClient) {
    state = file.write(stream, syntax, EET_UndefinedLength, nullptr, EGL_recalcGL, EPD_noChange, 0, 0, 0,
                       EWM_dontUpdateMeta);
    void* filled = nullptr;
    offile_off_t size = 0;
    stream.flushBuffer(filled, size);
    bytes.append(static_cast<const char*>(filled), static_cast<std::size_t>(size));
  }
  file.transferEnd();
  return state.good() ? bytes : "";
}

}  // namespace

std::size_t DicomMutator::place(const std::string& bytes) {
  // Half of all changes hit the header, where every byte means something.
  const std::size_t header = std::min<std::size_t>(bytes.size(), 3000);
  return below(2) == 0 ? below(header) : below(bytes.size());
}

void DicomMutator::change_bytes(std::string& bytes) {
  if (bytes.size() < 16) return;
  const std::size_t at = place(bytes), left = bytes.size() - at;
  switch (below(7)) {
    case 0: bytes.resize(at); break;
    case 1:
      for (std::size_t n = 0, count = 1 + below(16); n < count; ++n)
        bytes[place(bytes)] = static_cast<char>(below(256));
      break;
    case 2: bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8))); break;
    case 3: bytes.replace(at, std::min<std::size_t>(left, 4), std::min<std::size_t>(left, 4), '\xFF'); break;
    case 4: bytes.erase(at, std::min(left, 1 + below(64))); break;
    case 5: bytes.insert(at, bytes.substr(place(bytes), 1 + below(64))); break;
    case 6: {  // a number of text becomes another
      const std::string number = kNumbers[below(kNumbers.size())];
      bytes.replace(at, std::min(left, number.size()), number.substr(0, left));
      break;
    }
  }
}

bool DicomMutator::change_elements(std::string& bytes) {
  DcmInputBufferStream stream;
  stream.setBuffer(bytes.data(), static_cast<offile_off_t>(bytes.size()));
  stream.setEos();
  DcmFileFormat file;
  file.transferInit();
  if (file.read(stream, EXS_Unknown, EGL_noChange, DCM_MaxReadLength).bad()) return false;
  file.transferEnd();
  const E_TransferSyntax syntax = file.getDataset()->getOriginalXfer();
  for (std::size_t changes = 1 + below(3); changes > 0; --changes) {
    std::vector<Place> places;
    std::vector<DcmSequenceOfItems*> sequences;
    collect(*file.getDataset(), places, sequences);
    if (places.empty()) return false;
    const Place one = places[below(places.size())], other = places[below(places.size())];
    const DcmTag tag = one.element->getTag();
    switch (below(8)) {
      case 0: delete one.item->remove(one.element); break;
      case 1:  // the value of another element
        if (OFString value; other.element->getOFStringArray(value).good())
          one.item->putAndInsertOFStringArray(tag, value);
        break;
      case 2:
      case 3:
        one.item->putAndInsertString(tag, is_number(one.element->ident()) || below(4) == 0
                                              ? kNumbers[below(kNumbers.size())]
                                              : kTexts[below(kTexts.size())]);
        break;
      case 4:  // a number that is a little off, far off, or of the other sign
        if (Float64 value = 0; is_number(one.element->ident()) && one.element->getFloat64(value).good()) {
          const double factors[] = {-1.0, 10.0, 1.001, 0.1, 1e6};
          one.item->putAndInsertString(tag, std::to_string(value * factors[below(std::size(factors))]).c_str());
        }
        break;
      case 5: {  // an item more or less
        if (sequences.empty()) break;
        DcmSequenceOfItems* sequence = sequences[below(sequences.size())];
        if (sequence->card() == 0) break;
        DcmItem* item = sequence->getItem(below(sequence->card()));
        if (below(2) == 0)
          delete sequence->remove(item);
        else
          sequence->append(dynamic_cast<DcmItem*>(item->clone()));
        break;
      }
      case 6:  // in another item
        if (one.element->ident() != EVR_SQ) other.item->insert(dynamic_cast<DcmElement*>(one.element->clone()), OFTrue);
        break;
      case 7:  // of another VR
        if (OFString value; one.element->getOFStringArray(value).good()) {
          const DcmEVR vrs[] = {EVR_LO, EVR_DS, EVR_UI, EVR_UN, EVR_OB, EVR_FD};
          DcmTag of_other(tag.getXTag(), vrs[below(std::size(vrs))]);
          one.item->putAndInsertOFStringArray(of_other, value);
        }
        break;
    }
  }
  std::string changed = written(file, syntax);
  if (changed.empty()) return false;
  bytes = std::move(changed);
  return true;
}

std::string DicomMutator::with_mutated_elements(std::string file) {
  change_elements(file);
  return file;
}

std::string DicomMutator::mutated(std::string file) {
  const std::size_t kind = below(3);
  if (kind != 0 && !change_elements(file)) change_bytes(file);
  if (kind == 1) return file;
  for (std::size_t changes = 1 + below(kind == 0 ? 3 : 1); changes > 0; --changes) change_bytes(file);
  return file;
}

}  // namespace isoshift
