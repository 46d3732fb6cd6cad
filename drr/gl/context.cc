#include "drr/gl/context.h"

#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <fmt/format.h>

#include <array>
#include <cstring>
#include <optional>

#include "base/error.h"

namespace isoshift {
namespace {

constexpr const char* kInstead = "\n       Use --renderer cpu, which needs no OpenGL";

// libepoxy ends the process when libEGL is missing, so look before it does.
bool has_egl_library() {
  static const bool found = ::dlopen("libEGL.so.1", RTLD_LAZY | RTLD_LOCAL) != nullptr;
  return found;
}

bool has_word(const char* list, const char* word) {
  return list != nullptr && (" " + std::string(list) + " ").find(" " + std::string(word) + " ") != std::string::npos;
}

// Extensions of EGL itself, before there is a display.
bool has_client_extension(const char* name) { return has_word(eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS), name); }

std::vector<EGLDeviceEXT> hardware_devices() {
  const bool can_enumerate =
      has_client_extension("EGL_EXT_device_base") ||
      (has_client_extension("EGL_EXT_device_enumeration") && has_client_extension("EGL_EXT_device_query"));
  if (!can_enumerate || !has_client_extension("EGL_EXT_platform_device")) return {};
  std::array<EGLDeviceEXT, 32> all{};
  EGLint count = 0;
  if (!eglQueryDevicesEXT(static_cast<EGLint>(all.size()), all.data(), &count)) return {};
  std::vector<EGLDeviceEXT> hardware;
  for (EGLint n = 0; n < count; ++n)
    if (!has_word(eglQueryDeviceStringEXT(all[n], EGL_EXTENSIONS), "EGL_MESA_device_software"))
      hardware.push_back(all[n]);
  return hardware;
}

bool names_software(const std::string& renderer) {
  for (const char* name : {"llvmpipe", "softpipe", "swrast", "SwiftShader"})
    if (renderer.find(name) != std::string::npos) return true;
  return false;
}

}  // namespace

struct GlContext::Handles {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;

  ~Handles() {
    if (display == EGL_NO_DISPLAY) return;
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context != EGL_NO_CONTEXT) eglDestroyContext(display, context);
    // The display is shared by all contexts of the process: terminating it here would end theirs.
  }

  // Opens a display and makes an OpenGL 4.5 core context current on it; otherwise says why not.
  std::optional<std::string> open(EGLenum platform, void* native) {
    display = eglGetPlatformDisplayEXT(platform, native, nullptr);
    EGLint major = 0, minor = 0;
    if (display == EGL_NO_DISPLAY || !eglInitialize(display, &major, &minor)) {
      display = EGL_NO_DISPLAY;
      return "its EGL display cannot be opened";
    }
    if (!eglBindAPI(EGL_OPENGL_API)) return "its EGL has no OpenGL";
    if (!epoxy_has_egl_extension(display, "EGL_KHR_surfaceless_context")) return "its EGL needs a window";
    const std::array<EGLint, 3> config_attributes = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint configs = 0;
    if (!eglChooseConfig(display, config_attributes.data(), &config, 1, &configs) || configs < 1) config = nullptr;
    const std::array<EGLint, 7> attributes = {
        EGL_CONTEXT_MAJOR_VERSION,           4,       EGL_CONTEXT_MINOR_VERSION, 5, EGL_CONTEXT_OPENGL_PROFILE_MASK,
        EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
    context = eglCreateContext(display, config, EGL_NO_CONTEXT, attributes.data());
    if (context == EGL_NO_CONTEXT || !eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context))
      return "it has no OpenGL 4.5";
    // The version may be less than asked for where the driver's is overridden.
    if (epoxy_gl_version() < 45)
      return fmt::format("its OpenGL is {}.{}, expected 4.5", epoxy_gl_version() / 10, epoxy_gl_version() % 10);
    return std::nullopt;
  }
};

GlContext::GlContext(GlDevice device) : handles_(std::make_unique<Handles>()) {
  if (!has_egl_library())
    throw Error(fmt::format("no OpenGL: the library libEGL.so.1 is missing (Debian package libegl1).{}", kInstead));
  std::optional<std::string> failure;
  if (device == GlDevice::kHardware) {
    failure = "there is no GPU that EGL knows";
    for (const EGLDeviceEXT native : hardware_devices()) {
      handles_ = std::make_unique<Handles>();
      failure = handles_->open(EGL_PLATFORM_DEVICE_EXT, native);
      if (!failure) break;
    }
  } else if (has_client_extension("EGL_MESA_platform_surfaceless")) {
    failure = handles_->open(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY);
  } else {
    failure = "Mesa is missing (Debian packages libegl-mesa0 and libgl1-mesa-dri)";
  }
  if (!failure) {
    renderer_ = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
    version_ = reinterpret_cast<const char*>(glGetString(GL_VERSION));
    is_software_ = names_software(renderer_);
    if (device == GlDevice::kHardware && is_software_) failure = fmt::format("what it offers is {}", renderer_);
  }
  if (failure)
    throw Error(fmt::format("no {} OpenGL: {}.{}{}", device == GlDevice::kHardware ? "hardware" : "software", *failure,
                            kInstead,
                            device == GlDevice::kHardware ? ", or --gl software to run this one on the CPU" : ""));
}

GlContext::~GlContext() = default;

void GlContext::make_current() const {
  if (!eglMakeCurrent(handles_->display, EGL_NO_SURFACE, EGL_NO_SURFACE, handles_->context))
    throw Error(fmt::format("OpenGL on {} cannot be used: EGL error {:#x}", renderer_, eglGetError()));
}

void GlContext::check(const char* doing) const {
  if (const GLenum error = glGetError(); error != GL_NO_ERROR)
    throw Error(fmt::format(
        "{}: {}{}.{}", renderer_, doing,
        error == GL_OUT_OF_MEMORY ? ": out of its memory" : fmt::format(": OpenGL error {:#x}", error), kInstead));
}

std::optional<double> seconds_of(const GlTimer& timer, const GlContext& context) {
  if (context.is_software()) return std::nullopt;
  context.make_current();
  return timer.seconds();
}

std::vector<std::string> describe_gl_devices() {
  std::vector<std::string> lines;
  for (const GlDevice device : {GlDevice::kHardware, GlDevice::kSoftware}) {
    const char* kind = device == GlDevice::kHardware ? "hardware" : "software";
    try {
      const GlContext context(device);
      lines.push_back(fmt::format("{}: {}, OpenGL {}{}", kind, context.renderer(), context.version(),
                                  device == GlDevice::kHardware ? "" : " (only with --gl software)"));
    } catch (const Error& error) {
      const std::string reason = error.what();
      lines.push_back(fmt::format("{}: none; {}", kind, reason.substr(0, reason.find('\n'))));
    }
  }
  return lines;
}

bool has_hardware_gl() {
  static const bool found = [] {
    try {
      const GlContext context(GlDevice::kHardware);
      return true;
    } catch (const Error&) {
      return false;
    }
  }();
  return found;
}

}  // namespace isoshift
