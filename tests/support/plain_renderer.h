#pragma once
// A renderer reduced to what every renderer can do.

#include "drr/renderer.h"

namespace isoshift {

// The line integrals of another renderer, without its derivatives, and brought back from the GPU. Borrows it.
class PlainRenderer final : public Renderer {
 public:
  explicit PlainRenderer(Renderer& renderer) : renderer_(renderer) {}
  RenderResult render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                      const PixelSet& pixels) override {
    return renderer_.render(views, room_from_patient, pixels);
  }
  RendererKind kind() const override { return renderer_.kind(); }
  std::string device() const override { return renderer_.device(); }

 private:
  Renderer& renderer_;
};

}  // namespace isoshift
