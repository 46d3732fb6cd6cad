#pragma once
// Move-only OpenGL objects: buffers, textures, a render target, programs, a timer. All need a current GlContext. Those
// that end without one are left to the end of their context.

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace isoshift {

// The name of an OpenGL object, deleted at the end of its owner.
class GlName {
 public:
  using Delete = void (*)(std::uint32_t name);
  GlName(std::uint32_t name, Delete remove) : name_(name), remove_(remove) {}
  GlName(GlName&& other) noexcept : name_(std::exchange(other.name_, 0)), remove_(other.remove_) {}
  GlName& operator=(GlName&& other) noexcept {
    std::swap(name_, other.name_);
    std::swap(remove_, other.remove_);
    return *this;
  }
  ~GlName();
  std::uint32_t get() const { return name_; }

 private:
  std::uint32_t name_;
  Delete remove_;
};

// Memory of the host into which the GPU copies, mapped once for as long as it exists. To ask the driver for the bytes
// of a buffer instead took ten times as long on an NVIDIA H100 where the buffer was much larger than what was wanted.
class MappedCopy {
 public:
  static constexpr std::size_t kMostBytes = std::size_t{16} << 20;

  // So many bytes of a buffer, at most kMostBytes, valid until the next call. Waits until they are there.
  std::span<const std::byte> of(std::uint32_t buffer, std::size_t first, std::size_t bytes);

 private:
  std::optional<GlName> name_;
  const std::byte* mapped_ = nullptr;
  std::size_t capacity_ = 0;
};

// A buffer that grows as needed: storage for shaders, or attributes of vertices.
class Buffer {
 public:
  Buffer();
  void upload(std::span<const std::byte> bytes);
  void reserve(std::size_t bytes);  // what it held is lost
  void fill(float value);           // all of it
  // Appends the first `count` values, which shaders wrote, to others. Waits until they are there.
  template <class T>
  void append_to(std::vector<T>& values, std::size_t count) {
    constexpr std::size_t kMost = MappedCopy::kMostBytes / sizeof(T);
    for (std::size_t first = 0; first < count; first += kMost) {
      const std::size_t part = std::min(kMost, count - first);
      const auto* begin = reinterpret_cast<const T*>(copy_.of(get(), first * sizeof(T), part * sizeof(T)).data());
      values.insert(values.end(), begin, begin + part);
    }
  }
  void bind(std::uint32_t slot) const;  // as shader storage
  std::uint32_t get() const { return name_.get(); }

 private:
  GlName name_;
  std::size_t capacity_ = 0;
  MappedCopy copy_;
};

// A 3D texture of one value per voxel, linearly interpolated, 0 outside: voxel i lies at texture coordinate
// (i + 1/2) / size. Integers read as 0 to 1.
class Texture3d {
 public:
  // Throws Error where the driver's limit on edges is smaller than the volume.
  Texture3d(const Eigen::Vector3i& size, std::span<const std::uint8_t> voxels);
  Texture3d(const Eigen::Vector3i& size, std::span<const std::uint16_t> voxels);
  Texture3d(const Eigen::Vector3i& size, std::span<const float> voxels);
  Texture3d(const Eigen::Vector3i& size, std::span<const Eigen::Vector2f> voxels);
  void bind(std::uint32_t slot) const;

 private:
  struct Format;
  Texture3d(const Eigen::Vector3i& size, const void* voxels, const Format& format);

  GlName name_;
};

// An image to render into: one float or four per pixel, with or without depth. Made anew when its size changes.
class RenderTarget {
 public:
  enum class Pixel { kOneFloat, kFourFloats };
  enum class Depth { kNone, kFloat };
  RenderTarget(Pixel pixel, Depth depth);

  // Makes this image the target of rendering, with that size; its content is lost. Throws Error if the size exceeds the
  // driver's limit.
  void resize_and_use(int columns, int rows);
  void clear(float depth) const;                 // all colors to 0
  void download(std::span<float> pixels) const;  // row by row; all of them or the first ones
  void bind(std::uint32_t slot) const;           // as a texture
  int columns() const { return columns_; }

 private:
  Pixel pixel_;
  Depth depth_;
  int columns_ = 0, rows_ = 0;
  GlName framebuffer_, color_, depth_buffer_;
};

// How vertex buffers are read.
class VertexArray {
 public:
  VertexArray();
  enum class Type { kUint32, kUint16, kUnitUint8, kUnitUint16, kFloat };  // kUnit...: as floats from 0 to 1
  // `components` of `type` per vertex, or per instance, tightly packed.
  void attribute(std::uint32_t location, const Buffer& buffer, Type type, int components, bool per_instance);
  void bind() const;

 private:
  GlName name_;
};

// A program. Sources start after the #version line; files are named in messages. Constructors throw Error with file,
// line and the driver's log.
struct ShaderSource {
  std::string text, file;
};
class Program {
 public:
  explicit Program(const ShaderSource& compute);
  Program(const ShaderSource& vertex, const ShaderSource& fragment);
  void use() const;
  std::uint32_t get() const { return name_.get(); }

 private:
  void link(const std::string& files) const;

  GlName name_;
};

// The time that the GPU is busy while a Running exists, by its own clock, in all since clear(). One at a time.
class GlTimer {
 public:
  class Running {
   public:
    Running() = default;
    ~Running();
    Running(const Running&) = delete;
    Running& operator=(const Running&) = delete;
  };

  void clear() { queries_.clear(); }
  [[nodiscard]] Running run();
  double seconds() const;  // waits until it is done

 private:
  std::vector<GlName> queries_;
};

// Column by column, double to float: how host matrices reach shaders.
glm::mat4 to_glm(const Eigen::Matrix4d& matrix);

// Sets a uniform of the program in use.
void set_uniform(int location, const Eigen::Matrix4d& matrix);
void set_uniform(int location, const Eigen::Matrix3d& matrix);
void set_uniform(int location, const Eigen::Vector3d& vector);

}  // namespace isoshift
