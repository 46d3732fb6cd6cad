#include "serve/pages.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "serve/answers.h"
#include "serve/pages/choose.html.h"
#include "serve/pages/choose.js.h"
#include "serve/pages/icon.svg.h"
#include "serve/pages/manual.css.h"
#include "serve/pages/manual.html.h"
#include "serve/pages/manual.js.h"
#include "serve/pages/manual_view.js.h"
#include "serve/pages/pose.js.h"
#include "serve/pages/room.css.h"
#include "serve/pages/room.html.h"
#include "serve/pages/room.js.h"
#include "serve/pages/session.html.h"
#include "serve/pages/session.js.h"
#include "serve/pages/shared.js.h"
#include "serve/pages/sign_in.html.h"
#include "serve/pages/sign_in.js.h"
#include "serve/pages/trend.html.h"
#include "serve/pages/trend.js.h"

namespace isoshift {
namespace {

struct StaticFile {
  std::string_view path, type;
  const char* text;
};
constexpr std::string_view kScript = "text/javascript; charset=utf-8", kStyles = "text/css; charset=utf-8",
                           kSvg = "image/svg+xml";
constexpr std::array kStaticFiles = {
    StaticFile{"/icon.svg", kSvg, kIconSvg},        StaticFile{"/room.css", kStyles, kRoomCss},
    StaticFile{"/manual.css", kStyles, kManualCss}, StaticFile{"/shared.js", kScript, kSharedJs},
    StaticFile{"/sign_in.js", kScript, kSignInJs},  StaticFile{"/room.js", kScript, kRoomJs},
    StaticFile{"/session.js", kScript, kSessionJs}, StaticFile{"/trend.js", kScript, kTrendJs},
    StaticFile{"/manual.js", kScript, kManualJs},   StaticFile{"/manual_view.js", kScript, kManualViewJs},
    StaticFile{"/pose.js", kScript, kPoseJs},       StaticFile{"/choose.js", kScript, kChooseJs}};

const char* text_of(Page page) {
  switch (page) {
    case Page::kSessions: return kRoomHtml;
    case Page::kSession: return kSessionHtml;
    case Page::kManual: return kManualHtml;
    case Page::kTrend: return kTrendHtml;
    case Page::kChoose: return kChooseHtml;
    case Page::kSignIn: return kSignInHtml;
  }
  return "";
}

}  // namespace

HttpResponse page_answer(Page page) { return {.type = std::string(kHtml), .body = text_of(page)}; }

std::optional<HttpResponse> static_answer(const std::string& path) {
  const auto* file = std::ranges::find(kStaticFiles, path, &StaticFile::path);
  if (file == kStaticFiles.end()) return std::nullopt;
  return HttpResponse{.type = std::string(file->type), .body = file->text};
}

}  // namespace isoshift
