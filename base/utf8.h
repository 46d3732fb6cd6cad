#pragma once

namespace isoshift {

// Whether a byte of a text in UTF-8 begins a character.
constexpr bool begins_character(char byte) { return (static_cast<unsigned char>(byte) & 0xC0) != 0x80; }

}  // namespace isoshift
