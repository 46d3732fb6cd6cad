#pragma once
// Move-only OpenGL objects: a buffer, a 3D texture, a compute program. All need a current GlContext, at their end too.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <span>
#include <string>
#include <utility>

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
  ~GlName() {
    if (name_ != 0) remove_(name_);
  }
  std::uint32_t get() const { return name_; }

 private:
  std::uint32_t name_;
  Delete remove_;
};

// A shader storage buffer that grows as needed.
class Buffer {
 public:
  Buffer();
  void upload(std::span<const std::byte> bytes);
  void reserve(std::size_t bytes);  // what it held is lost
  void download(std::span<std::byte> bytes) const;
  void bind(std::uint32_t slot) const;

 private:
  GlName name_;
  std::size_t capacity_ = 0;
};

// A 3D texture of one float per voxel, linearly interpolated, 0 outside: voxel i lies at texture coordinate
// (i + 1/2) / size.
class Texture3d {
 public:
  // Throws Error where the driver's limit on edges is smaller than the volume.
  Texture3d(const Eigen::Vector3i& size, std::span<const float> voxels);
  void bind(std::uint32_t slot) const;

 private:
  GlName name_;
};

// A compute program. `source` starts after the #version line, `file` names it in messages.
class Program {
 public:
  // Throws Error with file, line and the driver's log.
  Program(const std::string& source, const std::string& file);
  void use() const;
  std::uint32_t get() const { return name_.get(); }

 private:
  GlName name_;
};

// Column by column, double to float: how host matrices reach shaders.
glm::mat4 to_glm(const Eigen::Matrix4d& matrix);

}  // namespace isoshift
