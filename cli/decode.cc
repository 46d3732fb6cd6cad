// isoshift-decode, not a command for people: the child process that decodes compressed pixels.

#include <cstdlib>

#include "base/option_name.h"
#include "io/dicom/decoder_process.h"

int main() {
  ::unsetenv("DCMDICTPATH");  // no variable of a shell may change what DCMTK takes attributes for
  isoshift::name_options(isoshift::OptionStyle::kFlags);
  return isoshift::run_decoder();
}
