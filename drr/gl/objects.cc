#include "drr/gl/objects.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <array>

#include "geometry/error.h"

namespace isoshift {
namespace {

std::uint32_t new_buffer() {
  GLuint name = 0;
  glCreateBuffers(1, &name);
  return name;
}

std::uint32_t new_texture_3d() {
  GLuint name = 0;
  glCreateTextures(GL_TEXTURE_3D, 1, &name);
  return name;
}

template <class Get, class GetLog>
std::string log_of(GLuint name, Get get, GetLog get_log) {
  GLint length = 0;
  get(name, GL_INFO_LOG_LENGTH, &length);
  std::string log(static_cast<std::size_t>(std::max(length, 1)), '\0');
  GLsizei written = 0;
  get_log(name, length, &written, log.data());
  log.resize(static_cast<std::size_t>(written));
  return log;
}

}  // namespace

Buffer::Buffer() : name_(new_buffer(), [](std::uint32_t name) { glDeleteBuffers(1, &name); }) {}

void Buffer::reserve(std::size_t bytes) {
  if (bytes <= capacity_) return;
  glNamedBufferData(name_.get(), static_cast<GLsizeiptr>(bytes), nullptr, GL_DYNAMIC_COPY);
  capacity_ = bytes;
}

void Buffer::upload(std::span<const std::byte> bytes) {
  reserve(bytes.size());
  glNamedBufferSubData(name_.get(), 0, static_cast<GLsizeiptr>(bytes.size()), bytes.data());
}

void Buffer::download(std::span<std::byte> bytes) const {
  glGetNamedBufferSubData(name_.get(), 0, static_cast<GLsizeiptr>(bytes.size()), bytes.data());
}

void Buffer::bind(std::uint32_t slot) const { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, slot, name_.get()); }

Texture3d::Texture3d(const Eigen::Vector3i& size, std::span<const float> voxels)
    : name_(new_texture_3d(), [](std::uint32_t name) { glDeleteTextures(1, &name); }) {
  GLint limit = 0;
  glGetIntegerv(GL_MAX_3D_TEXTURE_SIZE, &limit);
  if (size.maxCoeff() > limit)
    throw Error(
        fmt::format("a CT of {} x {} x {} voxels is too large for this OpenGL, whose limit is {} along each edge.\n"
                    "       Use --renderer cpu, which has no such limit",
                    size.x(), size.y(), size.z(), limit));
  glTextureStorage3D(name_.get(), 1, GL_R32F, size.x(), size.y(), size.z());
  for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTextureParameteri(name_.get(), filter, GL_LINEAR);
  for (const GLenum axis : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T, GL_TEXTURE_WRAP_R})
    glTextureParameteri(name_.get(), axis, GL_CLAMP_TO_BORDER);
  constexpr std::array<GLfloat, 4> kZero = {0, 0, 0, 0};
  glTextureParameterfv(name_.get(), GL_TEXTURE_BORDER_COLOR, kZero.data());
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  glTextureSubImage3D(name_.get(), 0, 0, 0, 0, size.x(), size.y(), size.z(), GL_RED, GL_FLOAT, voxels.data());
}

void Texture3d::bind(std::uint32_t slot) const { glBindTextureUnit(slot, name_.get()); }

Program::Program(const std::string& source, const std::string& file)
    : name_(glCreateProgram(), [](std::uint32_t name) { glDeleteProgram(name); }) {
  const GlName shader(glCreateShader(GL_COMPUTE_SHADER), [](std::uint32_t name) { glDeleteShader(name); });
  // The driver then counts lines as the file does.
  const std::string versioned = "#version 450 core\n#line 1\n" + source;
  const char* text = versioned.c_str();
  glShaderSource(shader.get(), 1, &text, nullptr);
  glCompileShader(shader.get());
  GLint done = GL_FALSE;
  glGetShaderiv(shader.get(), GL_COMPILE_STATUS, &done);
  if (done == GL_FALSE)
    throw Error(fmt::format("{}: does not compile on {}:\n{}", file,
                            reinterpret_cast<const char*>(glGetString(GL_RENDERER)),
                            log_of(shader.get(), glGetShaderiv, glGetShaderInfoLog)));
  glAttachShader(name_.get(), shader.get());
  glLinkProgram(name_.get());
  glGetProgramiv(name_.get(), GL_LINK_STATUS, &done);
  if (done == GL_FALSE)
    throw Error(fmt::format("{}: does not link on {}:\n{}", file,
                            reinterpret_cast<const char*>(glGetString(GL_RENDERER)),
                            log_of(name_.get(), glGetProgramiv, glGetProgramInfoLog)));
}

void Program::use() const { glUseProgram(name_.get()); }

glm::mat4 to_glm(const Eigen::Matrix4d& matrix) {
  glm::mat4 result;
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row) result[column][row] = static_cast<float>(matrix(row, column));
  return result;
}

}  // namespace isoshift
