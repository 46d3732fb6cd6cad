#include "drr/gl/objects.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>

#include "base/error.h"
#include "base/option_name.h"

namespace isoshift {
namespace {

GlName new_buffer() {
  GLuint name = 0;
  glCreateBuffers(1, &name);
  return {name, [](std::uint32_t old) { glDeleteBuffers(1, &old); }};
}

GlName new_texture(GLenum target) {
  GLuint name = 0;
  glCreateTextures(target, 1, &name);
  return {name, [](std::uint32_t old) { glDeleteTextures(1, &old); }};
}

GlName new_framebuffer() {
  GLuint name = 0;
  glCreateFramebuffers(1, &name);
  return {name, [](std::uint32_t old) { glDeleteFramebuffers(1, &old); }};
}

GlName new_vertex_array() {
  GLuint name = 0;
  glCreateVertexArrays(1, &name);
  return {name, [](std::uint32_t old) { glDeleteVertexArrays(1, &old); }};
}

GlName new_program() {
  return {glCreateProgram(), [](std::uint32_t old) { glDeleteProgram(old); }};
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

GlName compiled(GLenum stage, const ShaderSource& source) {
  GlName shader(glCreateShader(stage), [](std::uint32_t old) { glDeleteShader(old); });
  // The driver then counts lines as the file does.
  const std::string versioned = "#version 450 core\n#line 1\n" + source.text;
  const char* text = versioned.c_str();
  glShaderSource(shader.get(), 1, &text, nullptr);
  glCompileShader(shader.get());
  GLint done = GL_FALSE;
  glGetShaderiv(shader.get(), GL_COMPILE_STATUS, &done);
  if (done == GL_FALSE)
    throw Error(fmt::format("{}: does not compile on {}:\n{}", source.file,
                            reinterpret_cast<const char*>(glGetString(GL_RENDERER)),
                            log_of(shader.get(), glGetShaderiv, glGetShaderInfoLog)));
  return shader;
}

}  // namespace

GlName::~GlName() {
  if (name_ != 0 && eglGetCurrentContext() != EGL_NO_CONTEXT) remove_(name_);
}

std::span<const std::byte> MappedCopy::of(std::uint32_t buffer, std::size_t first, std::size_t bytes) {
  if (bytes > capacity_) {
    constexpr GLbitfield kMapped = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    const auto size = static_cast<GLsizeiptr>(bytes);
    name_.emplace(new_buffer());
    glNamedBufferStorage(name_->get(), size, nullptr, kMapped | GL_CLIENT_STORAGE_BIT);
    mapped_ = static_cast<const std::byte*>(glMapNamedBufferRange(name_->get(), 0, size, kMapped));
    capacity_ = mapped_ == nullptr ? 0 : bytes;
    if (mapped_ == nullptr) throw Error(fmt::format("this OpenGL gives no memory to read {} bytes back", bytes));
  }
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glCopyNamedBufferSubData(buffer, name_->get(), static_cast<GLintptr>(first), 0, static_cast<GLsizeiptr>(bytes));
  const std::unique_ptr<__GLsync, void (*)(GLsync)> copied(glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0),
                                                           [](GLsync sync) { glDeleteSync(sync); });
  // A GPU that was reset signals its fences, too: GlContext::check() then says so.
  constexpr GLuint64 kOneSecond = 1'000'000'000;
  while (glClientWaitSync(copied.get(), GL_SYNC_FLUSH_COMMANDS_BIT, kOneSecond) == GL_TIMEOUT_EXPIRED) continue;
  return {mapped_, bytes};
}

Buffer::Buffer() : name_(new_buffer()) {}

void Buffer::reserve(std::size_t bytes) {
  if (bytes <= capacity_) return;
  glNamedBufferData(name_.get(), static_cast<GLsizeiptr>(bytes), nullptr, GL_DYNAMIC_COPY);
  capacity_ = bytes;
}

void Buffer::upload(std::span<const std::byte> bytes) {
  reserve(bytes.size());
  glNamedBufferSubData(name_.get(), 0, static_cast<GLsizeiptr>(bytes.size()), bytes.data());
}

void Buffer::fill(float value) {
  if (capacity_ > 0) glClearNamedBufferData(name_.get(), GL_R32F, GL_RED, GL_FLOAT, &value);
}

void Buffer::bind(std::uint32_t slot) const { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, slot, name_.get()); }

struct Texture3d::Format {
  GLenum stored, given, type;
};

Texture3d::Texture3d(const Eigen::Vector3i& size, std::span<const std::uint8_t> voxels)
    : Texture3d(size, voxels.data(), {GL_R8, GL_RED, GL_UNSIGNED_BYTE}) {}
Texture3d::Texture3d(const Eigen::Vector3i& size, std::span<const std::uint16_t> voxels)
    : Texture3d(size, voxels.data(), {GL_R16, GL_RED, GL_UNSIGNED_SHORT}) {}
Texture3d::Texture3d(const Eigen::Vector3i& size, std::span<const float> voxels)
    : Texture3d(size, voxels.data(), {GL_R32F, GL_RED, GL_FLOAT}) {}
Texture3d::Texture3d(const Eigen::Vector3i& size, std::span<const Eigen::Vector2f> voxels)
    : Texture3d(size, voxels.data(), {GL_RG32F, GL_RG, GL_FLOAT}) {}

Texture3d::Texture3d(const Eigen::Vector3i& size, const void* voxels, const Format& format)
    : name_(new_texture(GL_TEXTURE_3D)) {
  GLint limit = 0;
  glGetIntegerv(GL_MAX_3D_TEXTURE_SIZE, &limit);
  if (size.maxCoeff() > limit)
    throw Error(
        fmt::format("a CT of {} x {} x {} voxels is too large for this OpenGL, whose limit is {} along each edge.\n"
                    "       Use {}, which has no such limit",
                    size.x(), size.y(), size.z(), limit, option("renderer", "cpu")));
  glTextureStorage3D(name_.get(), 1, format.stored, size.x(), size.y(), size.z());
  for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTextureParameteri(name_.get(), filter, GL_LINEAR);
  for (const GLenum axis : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T, GL_TEXTURE_WRAP_R})
    glTextureParameteri(name_.get(), axis, GL_CLAMP_TO_BORDER);
  constexpr std::array<GLfloat, 4> kZero = {0, 0, 0, 0};
  glTextureParameterfv(name_.get(), GL_TEXTURE_BORDER_COLOR, kZero.data());
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glTextureSubImage3D(name_.get(), 0, 0, 0, 0, size.x(), size.y(), size.z(), format.given, format.type, voxels);
}

void Texture3d::bind(std::uint32_t slot) const { glBindTextureUnit(slot, name_.get()); }

RenderTarget::RenderTarget(Pixel pixel, Depth depth)
    : pixel_(pixel),
      depth_(depth),
      framebuffer_(new_framebuffer()),
      color_(new_texture(GL_TEXTURE_2D)),
      depth_buffer_(new_texture(GL_TEXTURE_2D)) {}

void RenderTarget::resize_and_use(int columns, int rows) {
  if (columns != columns_ || rows != rows_) {
    GLint limit = 0;
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &limit);
    if (std::max(columns, rows) > limit)
      throw Error(
          fmt::format("an image of {} x {} pixels is too large for this OpenGL, whose limit is {} along each edge.\n"
                      "       Use {}, which has no such limit",
                      columns, rows, limit, option("renderer", "cpu")));
    color_ = new_texture(GL_TEXTURE_2D);
    glTextureStorage2D(color_.get(), 1, pixel_ == Pixel::kOneFloat ? GL_R32F : GL_RGBA32F, columns, rows);
    glNamedFramebufferTexture(framebuffer_.get(), GL_COLOR_ATTACHMENT0, color_.get(), 0);
    if (depth_ == Depth::kFloat) {
      depth_buffer_ = new_texture(GL_TEXTURE_2D);
      glTextureStorage2D(depth_buffer_.get(), 1, GL_DEPTH_COMPONENT32F, columns, rows);
      glNamedFramebufferTexture(framebuffer_.get(), GL_DEPTH_ATTACHMENT, depth_buffer_.get(), 0);
    }
    columns_ = columns;
    rows_ = rows;
  }
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.get());
  glViewport(0, 0, columns, rows);
}

void RenderTarget::clear(float depth) const {
  constexpr std::array<GLfloat, 4> kZero = {0, 0, 0, 0};
  glClearNamedFramebufferfv(framebuffer_.get(), GL_COLOR, 0, kZero.data());
  if (depth_ == Depth::kFloat) glClearNamedFramebufferfv(framebuffer_.get(), GL_DEPTH, 0, &depth);
}

void RenderTarget::download(std::span<float> pixels) const {
  const std::size_t components = pixel_ == Pixel::kOneFloat ? 1 : 4;
  const std::size_t row = components * static_cast<std::size_t>(columns_);
  const auto full_rows = static_cast<GLsizei>(pixels.size() / row);
  const auto get = [&](GLint first, GLsizei rows, GLsizei columns, std::span<float> into) {
    glGetTextureSubImage(color_.get(), 0, 0, first, 0, columns, rows, 1, components == 1 ? GL_RED : GL_RGBA, GL_FLOAT,
                         static_cast<GLsizei>(into.size_bytes()), into.data());
  };
  if (full_rows > 0) get(0, full_rows, columns_, pixels.first(static_cast<std::size_t>(full_rows) * row));
  if (const auto rest = pixels.subspan(static_cast<std::size_t>(full_rows) * row); !rest.empty())
    get(full_rows, 1, static_cast<GLsizei>(rest.size() / components), rest);
}

void RenderTarget::bind(std::uint32_t slot) const { glBindTextureUnit(slot, color_.get()); }

VertexArray::VertexArray() : name_(new_vertex_array()) {}

void VertexArray::attribute(std::uint32_t location, const Buffer& buffer, Type type, int components,
                            bool per_instance) {
  const auto bytes_of = [](Type of) {
    return of == Type::kUnitUint8 ? 1 : of == Type::kUint16 || of == Type::kUnitUint16 ? 2 : 4;
  };
  glVertexArrayVertexBuffer(name_.get(), location, buffer.get(), 0, components * bytes_of(type));
  switch (type) {
    case Type::kUint32: glVertexArrayAttribIFormat(name_.get(), location, components, GL_UNSIGNED_INT, 0); break;
    case Type::kUint16: glVertexArrayAttribIFormat(name_.get(), location, components, GL_UNSIGNED_SHORT, 0); break;
    case Type::kUnitUint8:
      glVertexArrayAttribFormat(name_.get(), location, components, GL_UNSIGNED_BYTE, GL_TRUE, 0);
      break;
    case Type::kUnitUint16:
      glVertexArrayAttribFormat(name_.get(), location, components, GL_UNSIGNED_SHORT, GL_TRUE, 0);
      break;
    case Type::kFloat: glVertexArrayAttribFormat(name_.get(), location, components, GL_FLOAT, GL_FALSE, 0); break;
  }
  glVertexArrayAttribBinding(name_.get(), location, location);
  glVertexArrayBindingDivisor(name_.get(), location, per_instance ? 1 : 0);
  glEnableVertexArrayAttrib(name_.get(), location);
}

void VertexArray::bind() const { glBindVertexArray(name_.get()); }

Program::Program(const ShaderSource& compute) : name_(new_program()) {
  const GlName shader = compiled(GL_COMPUTE_SHADER, compute);
  glAttachShader(name_.get(), shader.get());
  link(compute.file);
}

Program::Program(const ShaderSource& vertex, const ShaderSource& fragment) : name_(new_program()) {
  const GlName first = compiled(GL_VERTEX_SHADER, vertex);
  const GlName second = compiled(GL_FRAGMENT_SHADER, fragment);
  glAttachShader(name_.get(), first.get());
  glAttachShader(name_.get(), second.get());
  link(vertex.file + " with " + fragment.file);
}

void Program::link(const std::string& files) const {
  glLinkProgram(name_.get());
  GLint done = GL_FALSE;
  glGetProgramiv(name_.get(), GL_LINK_STATUS, &done);
  if (done == GL_FALSE)
    throw Error(fmt::format("{}: does not link on {}:\n{}", files,
                            reinterpret_cast<const char*>(glGetString(GL_RENDERER)),
                            log_of(name_.get(), glGetProgramiv, glGetProgramInfoLog)));
}

void Program::use() const { glUseProgram(name_.get()); }

GlTimer::Running::~Running() { glEndQuery(GL_TIME_ELAPSED); }

GlTimer::Running GlTimer::run() {
  GLuint name = 0;
  glCreateQueries(GL_TIME_ELAPSED, 1, &name);
  queries_.emplace_back(name, [](std::uint32_t old) { glDeleteQueries(1, &old); });
  glBeginQuery(GL_TIME_ELAPSED, name);
  return {};
}

double GlTimer::seconds() const {
  double sum = 0.0;
  for (const GlName& query : queries_) {
    GLuint64 nanoseconds = 0;
    glGetQueryObjectui64v(query.get(), GL_QUERY_RESULT, &nanoseconds);
    sum += 1e-9 * static_cast<double>(nanoseconds);
  }
  return sum;
}

glm::mat4 to_glm(const Eigen::Matrix4d& matrix) {
  glm::mat4 result;
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row) result[column][row] = static_cast<float>(matrix(row, column));
  return result;
}

void set_uniform(int location, const Eigen::Matrix4d& matrix) {
  const Eigen::Matrix4f values = matrix.cast<float>();
  glUniformMatrix4fv(location, 1, GL_FALSE, values.data());
}

void set_uniform(int location, const Eigen::Matrix3d& matrix) {
  const Eigen::Matrix3f values = matrix.cast<float>();
  glUniformMatrix3fv(location, 1, GL_FALSE, values.data());
}

void set_uniform(int location, const Eigen::Vector3d& vector) {
  const Eigen::Vector3f values = vector.cast<float>();
  glUniform3fv(location, 1, values.data());
}

}  // namespace isoshift
