#pragma once
// The irradiated field of an X-ray: where it is, and how sure that is. docs/algorithms.md, "The irradiated field".

#include "geometry/xray_image.h"
#include "setup/irradiated_field.h"

namespace isoshift {

IrradiatedField find_irradiated_field(const XrayImage& xray, double pixels_per_mm);

}  // namespace isoshift
