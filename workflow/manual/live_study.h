#pragma once
// A study on a screen: its X-rays, and its DRRs at any pose while a person moves the patient.

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "bodies/body_map.h"
#include "drr/renderer_pyramid.h"
#include "io/report/view_picture.h"
#include "io/study/study.h"
#include "registration/preprocess/preprocess.h"
#include "registration/region.h"
#include "workflow/observer.h"
#include "workflow/register/study_options.h"

namespace isoshift {

// After it has been made, several threads may use it.
class LiveStudy {
 public:
  // Reads the study. Throws Error for what registration would refuse, too.
  LiveStudy(const StudyOptions& options, Observer& observer);

  struct View {
    std::string label;
    Image<std::uint8_t> xray;  // at most 512 pixels along an edge
    Eigen::Vector2d isocenter_px = Eigen::Vector2d::Zero();
    // How a step in the room (mm, IEC 61217 fixed) moves what lies at the isocenter on the picture.
    Eigen::Matrix<double, 2, 3> px_per_mm = Eigen::Matrix<double, 2, 3>::Zero();
    Eigen::Vector3d from_source = Eigen::Vector3d::Zero();  // the direction of the central ray, of length 1
    std::vector<Polygon> field;                             // outlines of what registration compares
    int block = 1;                                          // pixels of the image as taken along an edge of one here
    std::array<std::string, 4> directions;                  // of the patient: at the left, right, upper and lower edge
  };
  const std::vector<View>& views() const { return views_; }
  const Study& study() const { return study_; }
  // As the pictures show them: pixels at full detail.
  std::span<const XrayView> cameras() const { return levels_.front().cameras; }

  // A structure or a body, which can be shown and registered alone.
  struct Part {
    std::string words;               // "structure PTV", "body 4: vertebra 1"
    std::vector<std::string> flags;  // of isoshift register: only this
  };
  const std::vector<Part>& parts() const { return parts_; }
  // The outlines of a part in every view, for a patient with this setup error.
  std::vector<std::vector<Polygon>> outlines_of(std::size_t part, const Eigen::Isometry3d& setup_error) const;

  // The DRR of every view as its X-ray shows it, of the X-ray's size, or a half or a quarter of that along an edge, for
  // a patient with this setup error (room, IEC 61217 fixed, about the isocenter). A line integral has the same gray
  // wherever the patient lies: one that makes DRRs of the planned pose look like the X-rays.
  enum class Detail { kFull, kHalf, kQuarter };
  std::vector<Image<std::uint8_t>> drrs(const Eigen::Isometry3d& setup_error, Detail detail) const;

 private:
  struct Level {
    std::vector<XrayView> cameras;
    Renderer* renderer = nullptr;  // of the pyramid
  };
  struct ShownPart {
    std::size_t part = 0;
    std::shared_ptr<const ProjectedRegion> region;  // as large as the CT
  };
  void find_parts();
  Volume<std::uint8_t> mask_of_part(std::size_t part) const;
  std::shared_ptr<const ProjectedRegion> region_of_part(std::size_t part) const;
  std::vector<Image<float>> line_integrals(const Eigen::Isometry3d& setup_error, const Level& level) const;

  Study study_;
  std::vector<View> views_;
  std::unique_ptr<RendererPyramid> renderers_;
  std::array<Level, 3> levels_;   // by Detail
  std::vector<GrayScale> grays_;  // of the DRR of every view
  BodyMap bodies_;
  std::vector<Part> parts_;              // the structures, then the bodies
  std::vector<std::string> structures_;  // names of the first parts
  std::vector<int> body_numbers_;        // of the others
  mutable std::mutex shown_mutex_;
  mutable ShownPart shown_;  // the last one
};

}  // namespace isoshift
