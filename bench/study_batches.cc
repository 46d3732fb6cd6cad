// DRRs of a study in batches of poses, for bench/python_batches.py, which renders the same from Python:
//
//   study_batches STUDY POSES...   prints, per number of poses, the seconds of one call of Renderer::render()

#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <memory>
#include <vector>

#include "drr/renderer.h"
#include "io/study/study.h"

namespace isoshift {
namespace {

// The planned pose and others, each 0.1 mm farther along the room's x.
std::vector<Eigen::Isometry3d> poses_of(const Study& study, int count) {
  std::vector<Eigen::Isometry3d> poses;
  poses.reserve(static_cast<std::size_t>(count));
  for (int n = 0; n < count; ++n)
    poses.emplace_back(Eigen::Translation3d(0.1 * n, 0.0, 0.0) * study.planned_room_from_patient);
  return poses;
}

void run(const std::filesystem::path& folder, const std::vector<int>& counts) {
  StudyRequest request;
  request.parts.study = folder;
  Notes notes;
  const Study study = load_study(request, notes, {});
  std::vector<XrayView> views;
  views.reserve(study.xrays.size());
  for (const XrayImage& xray : study.xrays) views.push_back(xray.view);
  const auto renderer = make_renderer(RendererKind::kCpu, study.ct->hu, {}, std::vector{Beam::kKilovoltage}, {});
  renderer->render(views, poses_of(study, 1), {});  // the first call fills caches
  for (const int count : counts) {
    const std::vector<Eigen::Isometry3d> poses = poses_of(study, count);
    const auto begin = std::chrono::steady_clock::now();
    const RenderResult result = renderer->render(views, poses, {});
    fmt::print("{} {:.6f}\n", count, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
}

}  // namespace
}  // namespace isoshift

int main(int argc, char** argv) {
  std::vector<int> counts;
  for (int n = 2; n < argc; ++n) counts.push_back(std::atoi(argv[n]));
  isoshift::run(argv[1], counts);
}
