#pragma once
// Registration by hand in a browser: what the page "manual" asks for.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/random_word.h"
#include "serve/http_message.h"
#include "serve/sign_ins.h"
#include "workflow/manual/live_study.h"
#include "workflow/manual/manual_registration.h"

namespace isoshift {

// May be called from several threads.
class ManualScreen {
 public:
  // `start`: the setup error that the page shows first.
  ManualScreen(const LiveStudy& study, ManualRegistration& registration,
               const Eigen::Isometry3d& start = Eigen::Isometry3d::Identity())
      : study_(study), registration_(registration), start_(start) {}

  // `what`: the part of the address behind that of the study.
  //
  //   GET study         the patient and the views, as JSON
  //   GET xrays         the X-rays: a byte per pixel, view by view
  //   POST drrs         the DRRs at a pose, likewise; with how long rendering took
  //   POST outlines     those of a part at a pose, view by view
  //   POST landmarks    the pose at which landmarks of the DRRs lie where they are in the X-rays
  //   GET state         what registers, or its result
  //   POST begin        registers from a pose, or keeps it
  //   POST cancel
  //   GET results/N/report.html   of a result that has not been handed over
  //
  // Status 409 for a request whose header X-Isoshift-Study is not the id that `study` tells: its page shows another
  // study, or the same in another state.
  HttpResponse answer(const HttpRequest& request, const SignedIn& who, const std::string& what);

 private:
  HttpResponse study() const;
  HttpResponse xrays() const;
  HttpResponse drrs(const HttpRequest& request) const;
  HttpResponse outlines(const HttpRequest& request) const;
  HttpResponse landmarks(const HttpRequest& request) const;
  std::vector<std::string> region_from(const nlohmann::ordered_json& region) const;
  HttpResponse begin(const HttpRequest& request, const SignedIn& who);
  HttpResponse state();
  HttpResponse report(const std::string& number) const;

  const LiveStudy& study_;
  ManualRegistration& registration_;
  Eigen::Isometry3d start_;
  const std::string id_ = random_word();
};

}  // namespace isoshift
