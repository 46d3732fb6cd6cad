#include "drr/gl/egl.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <array>
#include <utility>

// Newer than libepoxy 1.5.10.
#ifndef EGL_DRM_RENDER_NODE_FILE_EXT
#define EGL_DRM_RENDER_NODE_FILE_EXT 0x3377
#endif

namespace isoshift {
namespace {

bool can_be_loaded(const char* library) { return ::dlopen(library, RTLD_LAZY | RTLD_LOCAL) != nullptr; }

bool has_word(const char* list, const char* word) {
  return list != nullptr && (" " + std::string(list) + " ").find(" " + std::string(word) + " ") != std::string::npos;
}

// Whether EGL itself has an extension, before there is a display.
bool has_client_extension(const char* name) { return has_word(eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS), name); }

// The file by which the system knows a device, if EGL tells it.
std::string node_of(EGLDeviceEXT device) {
  const char* extensions = eglQueryDeviceStringEXT(device, EGL_EXTENSIONS);
  const std::array nodes = {std::pair("EGL_EXT_device_drm_render_node", EGL_DRM_RENDER_NODE_FILE_EXT),
                            std::pair("EGL_EXT_device_drm", EGL_DRM_DEVICE_FILE_EXT)};
  for (const auto& [extension, name] : nodes)
    if (has_word(extensions, extension))
      if (const char* node = eglQueryDeviceStringEXT(device, name)) return node;
  return {};
}

}  // namespace

std::optional<std::string> missing_gl_library() {
  static const auto missing = []() -> std::optional<std::string> {
    if (!can_be_loaded("libEGL.so.1")) return "the library libEGL.so.1 is missing (Debian package libegl1)";
    if (!can_be_loaded("libOpenGL.so.0") && !can_be_loaded("libGL.so.1"))
      return "the library libOpenGL.so.0 is missing (Debian package libopengl0)";
    return std::nullopt;
  }();
  return missing;
}

std::vector<EglDevice> egl_devices() {
  const bool can_enumerate =
      has_client_extension("EGL_EXT_device_base") ||
      (has_client_extension("EGL_EXT_device_enumeration") && has_client_extension("EGL_EXT_device_query"));
  if (!can_enumerate || !has_client_extension("EGL_EXT_platform_device")) return {};
  std::array<EGLDeviceEXT, 32> all{};
  EGLint count = 0;
  if (!eglQueryDevicesEXT(static_cast<EGLint>(all.size()), all.data(), &count)) return {};
  std::vector<EglDevice> devices;
  int gpus = 0;
  for (EGLint n = 0; n < count; ++n) {
    EglDevice& device = devices.emplace_back();
    device.handle = all[static_cast<std::size_t>(n)];
    device.is_software = has_word(eglQueryDeviceStringEXT(device.handle, EGL_EXTENSIONS), "EGL_MESA_device_software");
    const std::string node = device.is_software ? std::string() : node_of(device.handle);
    device.name = device.is_software ? "Mesa on the CPU"
                  : node.empty()     ? fmt::format("GPU {}", gpus++)
                                     : fmt::format("GPU {} ({})", gpus++, node);
  }
  return devices;
}

std::string egl_error() {
  const EGLint error = eglGetError();
  const auto name = [error] {
    switch (error) {
      case EGL_SUCCESS: return "EGL_SUCCESS";
      case EGL_NOT_INITIALIZED: return "EGL_NOT_INITIALIZED";
      case EGL_BAD_ACCESS: return "EGL_BAD_ACCESS";
      case EGL_BAD_ALLOC: return "EGL_BAD_ALLOC";
      case EGL_BAD_ATTRIBUTE: return "EGL_BAD_ATTRIBUTE";
      case EGL_BAD_CONFIG: return "EGL_BAD_CONFIG";
      case EGL_BAD_CONTEXT: return "EGL_BAD_CONTEXT";
      case EGL_BAD_DISPLAY: return "EGL_BAD_DISPLAY";
      case EGL_BAD_MATCH: return "EGL_BAD_MATCH";
      case EGL_BAD_PARAMETER: return "EGL_BAD_PARAMETER";
      case EGL_CONTEXT_LOST: return "EGL_CONTEXT_LOST";
      case EGL_BAD_DEVICE_EXT: return "EGL_BAD_DEVICE_EXT";
      default: return "EGL error";
    }
  };
  return fmt::format("{} ({:#x})", name(), error);
}

}  // namespace isoshift
