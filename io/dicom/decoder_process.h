#pragma once
// Compressed pixels of unknown origin are decoded in a process of their own, which can do nothing but that
// (decoder_confinement.h): a decoder that crashes or never ends costs one file, not the program (docs/dicom.md, 6.6). A
// child reads files without looking into them, and makes a process for each frame, so that no frame is decoded by what
// another may have taken over; between requests it waits.

#include <cstdint>
#include <filesystem>
#include <vector>

#include "io/dicom/dicom_dataset.h"

namespace isoshift {

// The program that decodes. To be set before anything is decoded.
void use_decoder(std::filesystem::path program);

// isoshift-decode, which was installed or built together with this program isoshift: a program of its own, since a
// small one starts and makes processes in less time.
std::filesystem::path decoder_of(const std::filesystem::path& isoshift);

// One compressed frame of a file that was read whole, as `bytes` bytes. Throws Error naming the file where the child
// refuses, dies, stalls, answers with another length, or finds another content in the file.
std::vector<std::uint8_t> frame_from_decoder(const DicomFile& file, int frame, std::size_t bytes);

// What isoshift-decode does: answers its parent until there are no more requests. Returns the exit status.
int run_decoder();

}  // namespace isoshift
