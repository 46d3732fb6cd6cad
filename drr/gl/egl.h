#pragma once
// EGL: its library, its devices, its errors.

#include <epoxy/egl.h>

#include <optional>
#include <string>
#include <vector>

namespace isoshift {

// A library without which libepoxy ends the process, so that it must be looked for first: what to tell people.
std::optional<std::string> missing_gl_library();

struct EglDevice {
  EGLDeviceEXT handle = EGL_NO_DEVICE_EXT;
  bool is_software = false;  // Mesa's own on the CPU
  std::string name;          // "GPU 0 (/dev/dri/renderD128)"
};

// All that EGL knows; GPUs are numbered from 0. Empty if EGL cannot list devices.
std::vector<EglDevice> egl_devices();

// The last error, such as "EGL_BAD_ALLOC (0x3003)".
std::string egl_error();

}  // namespace isoshift
