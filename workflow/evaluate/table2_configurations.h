#pragma once
// The configurations of Table 2 of the founding paper (Spoerk et al. 2012), as data: what is searched with, from where.

#include <span>

#include "registration/evaluate.h"
#include "workflow/register/registration_setup.h"

namespace isoshift {

// What "a random start displacement of 25 mm" may mean; the paper does not say.
enum class StartReading {
  kTranslation,  // translated by 25 mm, not turned
  kMtre,         // translated and turned, mTRE 25 mm
  kUpTo,         // translated and turned, mTRE spread evenly over 0 to 25 mm
};

struct Table2Configuration {
  const char* name = "";  // of its folder
  const char* renderer = "cpu";
  const char* similarity = "mi";
  const char* optimizer = "nelder-mead";
  int searches = 1;  // one after the other: each begins anew where the one before ended
  StartReading reading = StartReading::kTranslation;
  bool is_one_view = false;  // the first X-ray of the study alone
  double pixel_fraction = 0.05;
  double pixel_mm = 1.0;              // at the isocenter
  double relative_tolerance = 0.005;  // half of the renderer's rms error against trilinear, but at least this
  int starts = 150;
};

std::span<const Table2Configuration> table2_configurations();

// Where its runs start: never more than `most`.
StartProtocol protocol_of(const Table2Configuration& configuration, int most);

// How its runs search, not settled yet; everything else, such as the region, is as in `common`.
RegistrationRequest request_of(const Table2Configuration& configuration, const RegistrationRequest& common);

}  // namespace isoshift
