#pragma once
// What `isoshift inspect --bodies` shows of a CT.

#include <string>

#include "bodies/body_map.h"

namespace isoshift {

// A line per body: number, kind, name, center in patient mm, volume, the numbers of the bodies that it joins.
std::string bodies_table(const BodyMap& map);

// The bytes of a PNG: the bodies in colors with their numbers, seen from the front and from the left, each as it lies
// before the others.
std::string bodies_picture(const BodyMap& map, const std::string& title);

}  // namespace isoshift
