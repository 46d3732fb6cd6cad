#include "io/report/result_folder.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <array>
#include <fstream>
#include <functional>
#include <iterator>

#include "base/error.h"
#include "base/output_folder.h"
#include "base/parallel.h"
#include "base/text_file.h"
#include "io/objects/encapsulated_pdf.h"
#include "io/report/drawings.h"
#include "io/report/formats.h"

namespace isoshift {
namespace {

struct NamedPicture {
  const char* name;
  Image<std::uint8_t> ViewPicture::* picture;
  std::string ViewPngs::* png;
};
constexpr std::array<NamedPicture, 3> kPictures = {{{"xray", &ViewPicture::xray, &ViewPngs::xray},
                                                    {"planned", &ViewPicture::drr_planned, &ViewPngs::drr_planned},
                                                    {"found", &ViewPicture::drr_found, &ViewPngs::drr_found}}};

std::filesystem::path picture_path(const std::filesystem::path& folder, std::size_t view, const char* name) {
  return folder / fmt::format("view{}_{}.png", view + 1, name);
}

// All pictures of a view beside each other, for people without the report.
std::string comparison_png(const SetupResult::View& view) {
  constexpr double kWidth = 1600.0, kMargin = 6.0;
  const double height =
      0.2 * kWidth * view.picture.xray.rows / view.picture.xray.columns + 0.022 * kWidth + 2.0 * kMargin;
  Canvas canvas(Canvas::Kind::kPng, kWidth, height);
  draw_view(canvas, kMargin, kMargin, kWidth - 2.0 * kMargin, view);
  return canvas.finish();
}

EncapsulatedPdf document_of(const SetupResult& report, const ReportPage& page) {
  EncapsulatedPdf document{.identity = report.identity, .title = page.title};
  if (!report.plan_uid.empty()) document.sources.push_back({report.plan_class_uid, report.plan_uid});
  for (const SetupResult::View& view : report.views)
    if (document.sources.empty() || document.sources.back().sop_instance_uid != view.sop_instance_uid)
      document.sources.push_back({view.sop_class_uid, view.sop_instance_uid});
  if (!report.spatial_registration_uid.empty())
    document.sources.push_back({UID_SpatialRegistrationStorage, report.spatial_registration_uid});
  return document;
}

}  // namespace

void write_result(const SetupResult& report, const std::filesystem::path& folder) {
  const ReportPage page = report_page(report);
  const std::size_t views = report.views.size();
  std::string pdf;
  std::vector<ViewPngs> pictures(views);
  std::vector<std::string> comparisons(views);
  // To compress them takes longer than all else: each is made once, and all at the same time.
  std::vector<std::function<void()>> drawings = {[&] { pdf = pdf_report(report, page); }};
  for (std::size_t n = 0; n < views; ++n) {
    drawings.emplace_back([&, n] { comparisons[n] = comparison_png(report.views[n]); });
    for (const NamedPicture& named : kPictures)
      drawings.emplace_back([&, n] { pictures[n].*named.png = png_of(report.views[n].picture.*named.picture); });
  }
  parallel_for(std::size_t{0}, drawings.size(), [&](std::size_t n) { drawings[n](); });
  write_text(folder / kResultFile, json_report(report));
  write_text(folder / "report.txt", text_report(page));
  write_text(folder / "report.csv", csv_report(report));
  write_text(folder / "report.pdf", pdf);
  write_text(folder / "report.html", html_report(report, page, pictures));
  write_encapsulated_pdf(document_of(report, page), pdf, folder / "report.dcm");
  for (std::size_t n = 0; n < views; ++n) {
    for (const NamedPicture& named : kPictures) write_text(picture_path(folder, n, named.name), pictures[n].*named.png);
    write_text(folder / fmt::format("view{}.png", n + 1), comparisons[n]);
  }
}

SetupResult read_report(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / kResultFile;
  expect_no_pipe(path);
  std::ifstream file(path, std::ios::binary);
  const std::string json{std::istreambuf_iterator<char>(file), {}};
  if (!file) throw Error(fmt::format("{}: cannot be read: this is not the folder of a result", path.string()));
  return report_from_json(json, path.string());
}

SetupResult read_result(const std::filesystem::path& folder) {
  SetupResult report = read_report(folder);
  for (std::size_t n = 0; n < report.views.size(); ++n) {
    ViewPicture& picture = report.views[n].picture;
    for (const auto& [name, member, png] : kPictures) picture.*member = read_gray_png(picture_path(folder, n, name));
    for (const auto& [name, member, png] : kPictures)
      if ((picture.*member).columns != picture.xray.columns || (picture.*member).rows != picture.xray.rows)
        throw Error(
            fmt::format("{}: is not of the size of the X-ray's picture", picture_path(folder, n, name).string()));
  }
  return report;
}

}  // namespace isoshift
