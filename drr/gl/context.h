#pragma once
// Headless OpenGL 4.5 through EGL. Hardware first; a software renderer only when asked for.

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drr/gl/device.h"
#include "drr/gl/objects.h"

namespace isoshift {

// An OpenGL 4.5 core context without a window, and the programs that were compiled for it. For one thread;
// make_current() before use.
class GlContext {
 public:
  // Throws Error saying why there is none, and what to use instead: no EGL library, no device of that kind, no
  // OpenGL 4.5.
  explicit GlContext(const GlChoice& choice);
  ~GlContext();
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  // Throws Error if it is current in another thread, or lost.
  void make_current() const;
  // The same for destructors, where there is nobody to tell.
  void try_make_current() const noexcept;

  // As the driver names itself: GL_RENDERER and GL_VERSION.
  const std::string& renderer() const { return renderer_; }
  const std::string& version() const { return version_; }
  const std::string& uuid() const { return uuid_; }  // of the device, hex digits; empty if the driver tells none
  const std::string& device_name() const { return device_name_; }  // as EGL lists it: "GPU 0 (/dev/dri/renderD128)"
  bool is_software() const { return is_software_; }
  bool is_robust() const { return is_robust_; }  // says so if it is lost, and keeps shaders within their buffers
  std::int64_t largest_volume_edge() const;      // of 3D textures, texels
  std::int64_t largest_buffer_bytes() const { return largest_buffer_bytes_; }  // of storage that shaders see

  // A program that is compiled when it is first asked for. Throws Error as Program does.
  const Program& program(const ShaderSource& compute);
  const Program& program(const ShaderSource& vertex, const ShaderSource& fragment);

  // Throws Error if OpenGL has reported one since the last call, or if the GPU was reset; `doing` says what was being
  // done. Images are to be believed only after this.
  void check(const char* doing) const;
  bool is_lost() const { return is_lost_; }

 private:
  struct Handles;
  // What speaks against a device; otherwise its context is open and described.
  std::optional<std::string> open(const GlChoice& choice, void* device);

  std::unique_ptr<Handles> handles_;
  std::string renderer_, version_, uuid_, device_name_;
  bool is_software_ = false, is_robust_ = false;
  std::int64_t largest_buffer_bytes_ = 0;
  mutable bool is_lost_ = false;
  std::map<std::string, Program> programs_;  // by their sources
};

// The context of this process for that choice, which all renderers share: opened when first asked for and kept to the
// end; opened anew where the last one was lost. All that renders with it is of one thread. Throws Error as GlContext
// does.
GlContext& gl_context(const GlChoice& choice);

// What a timer of this context has counted; nothing on llvmpipe, whose clock stands still for compute shaders and has
// returned the machine's uptime for others.
std::optional<double> seconds_of(const GlTimer& timer, const GlContext& context);

// GPUs that EGL knows, whether they work or not.
int count_gpus();

// Why no hardware context can be had; nothing where one can. Tried once per process and choice; from any thread.
std::optional<std::string> why_no_gpu(const std::string& gpu = {});
inline bool has_hardware_gl() { return !why_no_gpu(); }

}  // namespace isoshift
