#include "drr/gl/context.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <mutex>

#include "base/error.h"
#include "base/option_name.h"
#include "drr/gl/egl.h"

namespace isoshift {
namespace {

std::string instead() { return "\n       Use " + option("renderer", "cpu") + ", which needs no OpenGL"; }

bool names_software(const std::string& renderer) {
  return std::ranges::any_of(std::array{"llvmpipe", "softpipe", "swrast", "SwiftShader"},
                             [&](const char* name) { return renderer.find(name) != std::string::npos; });
}

std::string gl_string(GLenum name) {
  const auto* text = reinterpret_cast<const char*>(glGetString(name));
  return text == nullptr ? "" : text;
}

std::string device_uuid() {
  if (!epoxy_has_gl_extension("GL_EXT_memory_object")) return {};
  std::array<GLubyte, GL_UUID_SIZE_EXT> bytes{};
  glGetUnsignedBytei_vEXT(GL_DEVICE_UUID_EXT, 0, bytes.data());
  return glGetError() == GL_NO_ERROR ? fmt::format("{:02x}", fmt::join(bytes, "")) : "";
}

// The devices among which a choice chooses, as EGL lists them.
std::vector<EglDevice> candidates(const GlChoice& choice) {
  std::vector<EglDevice> devices = egl_devices();
  std::erase_if(devices,
                [&](const EglDevice& device) { return device.is_software != (choice.kind == GlDevice::kSoftware); });
  return devices;
}

std::string why_lost(GLenum status) {
  switch (status) {
    case GL_GUILTY_CONTEXT_RESET: return "what was running on it had to be ended";
    case GL_INNOCENT_CONTEXT_RESET: return "another program on it had to be ended";
    default: return "the driver does not say why";
  }
}

}  // namespace

struct GlContext::Handles {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;

  Handles() = default;
  Handles(const Handles&) = delete;
  Handles& operator=(const Handles&) = delete;
  ~Handles() {
    if (display == EGL_NO_DISPLAY) return;
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context != EGL_NO_CONTEXT) eglDestroyContext(display, context);
    // The display is shared by all contexts of the process: terminating it here would end theirs.
  }

  // Opens a display and makes an OpenGL 4.5 core context current on it, robust if that can be had; otherwise says why
  // not.
  std::optional<std::string> open(void* device, bool& is_robust) {
    display = eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, device, nullptr);
    EGLint major = 0, minor = 0;
    if (display == EGL_NO_DISPLAY || !eglInitialize(display, &major, &minor)) {
      display = EGL_NO_DISPLAY;
      return fmt::format("its EGL display cannot be opened: {}", egl_error());
    }
    if (!eglBindAPI(EGL_OPENGL_API)) return fmt::format("its EGL has no OpenGL: {}", egl_error());
    if (!epoxy_has_egl_extension(display, "EGL_KHR_surfaceless_context")) return "its EGL needs a window";
    const std::array<EGLint, 3> config_attributes = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint configs = 0;
    if (!eglChooseConfig(display, config_attributes.data(), &config, 1, &configs) || configs < 1) config = nullptr;
    const auto create = [&](std::vector<EGLint> attributes) {
      attributes.insert(attributes.begin(), {EGL_CONTEXT_MAJOR_VERSION, 4, EGL_CONTEXT_MINOR_VERSION, 5,
                                             EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT});
      attributes.push_back(EGL_NONE);
      context = eglCreateContext(display, config, EGL_NO_CONTEXT, attributes.data());
      return context != EGL_NO_CONTEXT;
    };
    const bool has_robust_attributes = major > 1 || minor >= 5;
    is_robust =
        has_robust_attributes && create({EGL_CONTEXT_OPENGL_ROBUST_ACCESS, EGL_TRUE,
                                         EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY, EGL_LOSE_CONTEXT_ON_RESET});
    if (!is_robust && !create({})) return fmt::format("it has no OpenGL 4.5: {}", egl_error());
    if (!eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context))
      return fmt::format("its OpenGL 4.5 cannot be used: {}", egl_error());
    // The version may be less than asked for where the driver's is overridden.
    if (epoxy_gl_version() < 45)
      return fmt::format("its OpenGL is {}.{}, expected 4.5", epoxy_gl_version() / 10, epoxy_gl_version() % 10);
    return std::nullopt;
  }
};

GlContext::GlContext(const GlChoice& choice) {
  const char* kind = choice.kind == GlDevice::kHardware ? "hardware" : "software";
  const auto fail = [&](const std::string& why) {
    throw Error(fmt::format(
        "no {} OpenGL: {}.{}{}", kind, why, instead(),
        choice.kind == GlDevice::kHardware ? ", or " + option("gl", "software") + " to run this one on the CPU" : ""));
  };
  if (const auto missing = missing_gl_library()) throw Error(fmt::format("no OpenGL: {}.{}", *missing, instead()));
  const std::vector<EglDevice> devices = candidates(choice);
  if (devices.empty())
    fail(choice.kind == GlDevice::kHardware ? "there is no GPU that EGL knows"
                                            : "Mesa is missing (Debian packages libegl-mesa0 and libgl1-mesa-dri)");
  std::vector<std::string> names(devices.size());
  std::ranges::transform(devices, names.begin(), &EglDevice::name);
  try {
    const std::size_t chosen = first_usable(names, [&](std::size_t n) -> std::optional<std::string> {
      if (!choice.means_number(static_cast<int>(n))) return "is not the one asked for";
      return open(choice, devices[n].handle);
    });
    device_name_ = names[chosen];
  } catch (const Error& none) {
    fail(none.what());
  }
}

GlContext::~GlContext() { try_make_current(); }

std::optional<std::string> GlContext::open(const GlChoice& choice, void* device) {
  handles_ = std::make_unique<Handles>();
  if (auto failure = handles_->open(device, is_robust_)) return failure;
  renderer_ = gl_string(GL_RENDERER);
  version_ = gl_string(GL_VERSION);
  uuid_ = device_uuid();
  is_software_ = names_software(renderer_);
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &largest_buffer_bytes_);
  if (choice.kind == GlDevice::kHardware && is_software_) return fmt::format("what it offers is {}", renderer_);
  if (!choice.means_uuid(uuid_)) return "is not the one asked for";
  return std::nullopt;
}

void GlContext::make_current() const {
  if (is_lost_) throw Error(fmt::format("OpenGL on {} was lost.{}", renderer_, instead()));
  if (eglGetCurrentContext() == handles_->context) return;
  if (!eglMakeCurrent(handles_->display, EGL_NO_SURFACE, EGL_NO_SURFACE, handles_->context))
    throw Error(fmt::format("OpenGL on {} cannot be used: {}.{}", renderer_, egl_error(), instead()));
}

void GlContext::try_make_current() const noexcept {
  if (handles_ && handles_->display != EGL_NO_DISPLAY)
    eglMakeCurrent(handles_->display, EGL_NO_SURFACE, EGL_NO_SURFACE, handles_->context);
}

std::int64_t GlContext::largest_volume_edge() const {
  make_current();
  GLint64 texels = 0;
  glGetInteger64v(GL_MAX_3D_TEXTURE_SIZE, &texels);
  return texels;
}

const Program& GlContext::program(const ShaderSource& compute) {
  make_current();
  const auto known = programs_.find(compute.text);
  return known != programs_.end() ? known->second : programs_.emplace(compute.text, Program(compute)).first->second;
}

const Program& GlContext::program(const ShaderSource& vertex, const ShaderSource& fragment) {
  make_current();
  const std::string sources = vertex.text + fragment.text;
  const auto known = programs_.find(sources);
  return known != programs_.end() ? known->second : programs_.emplace(sources, Program(vertex, fragment)).first->second;
}

void GlContext::check(const char* doing) const {
  if (const GLenum status = glGetGraphicsResetStatus(); status != GL_NO_ERROR) {
    is_lost_ = true;
    throw Error(fmt::format("{}: {}: the GPU was reset, {}.{}", renderer_, doing, why_lost(status), instead()));
  }
  if (const GLenum error = glGetError(); error != GL_NO_ERROR)
    throw Error(fmt::format(
        "{}: {}{}.{}", renderer_, doing,
        error == GL_OUT_OF_MEMORY ? ": out of its memory" : fmt::format(": OpenGL error {:#x}", error), instead()));
}

GlContext& gl_context(const GlChoice& choice) {
  struct Known {
    GlChoice choice;
    std::unique_ptr<GlContext> context;
  };
  // Never freed: drivers have ended before the last object of a process does.
  static auto& known = *new std::vector<Known>;
  for (const Known& one : known)
    if (one.choice == choice && !one.context->is_lost()) return *one.context;
  return *known.emplace_back(choice, std::make_unique<GlContext>(choice)).context;
}

std::optional<double> seconds_of(const GlTimer& timer, const GlContext& context) {
  if (context.is_software()) return std::nullopt;
  context.make_current();
  return timer.seconds();
}

int count_gpus() { return missing_gl_library() ? 0 : static_cast<int>(candidates(GlDevice::kHardware).size()); }

std::optional<std::string> why_no_gpu(const std::string& gpu) {
  static std::mutex asking;
  static std::map<std::string, std::optional<std::string>> known;
  const std::lock_guard lock(asking);
  const auto [at, is_new] = known.try_emplace(gpu);
  if (is_new) try {
      gl_context({GlDevice::kHardware, gpu});
    } catch (const Error& error) {
      const std::string why = error.what();
      at->second = why.substr(0, why.find(".\n"));
    }
  return at->second;
}

}  // namespace isoshift
