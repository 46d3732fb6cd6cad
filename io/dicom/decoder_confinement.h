#pragma once

namespace isoshift {

// Confines this process, before it looks at what a hostile file holds, for the rest of its life: at most 4 GiB of
// memory and 10 s of processor time, no file, no network, no other program. It may compute, send through the sockets
// that are open, and end; the kernel ends it where it asks for anything else. Throws Error if the kernel refuses to do
// so.
void confine_decoder();

}  // namespace isoshift
