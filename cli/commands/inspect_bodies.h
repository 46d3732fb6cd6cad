#pragma once
// What `isoshift inspect --bodies` shows of a CT.

#include <filesystem>
#include <string>
#include <vector>

#include "bodies/body_map.h"
#include "io/dicom/ct_series.h"
#include "io/dicom/rt_structures.h"

namespace isoshift {

// Structures drawn on this CT that are single bones by their names, such as "L3", "Mandible" or "Femur_L".
std::vector<DrawnBone> drawn_bones(const RtStructures& structures, const CtSeries& ct);

// A line per body: number, kind, name, center in patient mm, volume, the numbers of the bodies that it joins.
std::string bodies_table(const BodyMap& map);

// The bytes of a PNG: the bodies in colors with their numbers, seen from the front and from the left, each as it lies
// before the others.
std::string bodies_picture(const BodyMap& map, const std::string& title);

}  // namespace isoshift
