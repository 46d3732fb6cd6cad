// Runs the tests. Compressed pixels are decoded as in the program: by a child process of it.

#include <gmock/gmock.h>

#include "base/option_name.h"
#include "base/process.h"
#include "io/dicom/decoder_process.h"

int main(int argc, char** argv) {
  testing::InitGoogleMock(&argc, argv);
  isoshift::use_decoder(isoshift::decoder_of(ISOSHIFT_PROGRAM));
  isoshift::name_options(isoshift::OptionStyle::kFlags);
  isoshift::use_program(ISOSHIFT_PROGRAM);
  return RUN_ALL_TESTS();
}
