#pragma once
// Headless OpenGL 4.5 through EGL. Hardware first; a software renderer only when asked for.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drr/gl/objects.h"
#include "drr/renderer.h"

namespace isoshift {

// A current OpenGL 4.5 core context without a window. One thread at a time; make_current() before use.
class GlContext {
 public:
  // Throws Error saying why there is none, and what to use instead: no EGL library, no device of that kind, no
  // OpenGL 4.5.
  explicit GlContext(GlDevice device);
  ~GlContext();
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  void make_current() const;

  // GL_RENDERER and GL_VERSION, as the driver names itself.
  const std::string& renderer() const { return renderer_; }
  const std::string& version() const { return version_; }
  bool is_software() const { return is_software_; }

  // Throws Error if OpenGL has reported one since the last call; `doing` says what was being done.
  void check(const char* doing) const;

 private:
  struct Handles;
  std::unique_ptr<Handles> handles_;
  std::string renderer_, version_;
  bool is_software_ = false;
};

// What a timer of this context has counted; nothing on llvmpipe, whose clock stands still for compute shaders and has
// returned the machine's uptime for others.
std::optional<double> seconds_of(const GlTimer& timer, const GlContext& context);

// What there is to render on, a line each, for people; never throws.
std::vector<std::string> describe_gl_devices();

// Whether a hardware context can be had. Tried once per process.
bool has_hardware_gl();

}  // namespace isoshift
