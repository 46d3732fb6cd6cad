#pragma once

#include "base/error.h"
#include "geometry/xray_view.h"

namespace isoshift {

// What a renderer has prepared for a beam, in a map by beams. Throws UsageError for a beam that it was not made for.
template <class Map>
auto& of_beam(Map& prepared, Beam beam) {
  const auto found = prepared.find(beam);
  if (found == prepared.end())
    throw UsageError(beam == Beam::kMegavoltage ? "a view is megavoltage: the renderer was not made for that beam"
                                                : "a view is kilovoltage: the renderer was not made for that beam");
  return found->second;
}

}  // namespace isoshift
