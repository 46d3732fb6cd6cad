#pragma once
// Every limit beyond which a measurement speaks against a registration (quality/findings.h), with its unit and its
// source. docs/algorithms.md says what is measured, docs/evaluation.md on what.

#include "geometry/rotation.h"

namespace isoshift::limits {

// The search. A share of the bound; mm and rad between the ends of searches, or without one of the views.
inline constexpr double kAtBoundShare = 0.99;
inline constexpr double kMaxSpreadMm = 1.0, kMaxSpreadRad = rad_from_deg(1.0);

// Gradient correlation. A patient exactly on plan may lose a little by noise: on phantoms and real data less than
// 0.001.
inline constexpr double kSimilarityNoise = 0.005;
// Mean over the views. Right patients reached 0.63 to 0.98 on real data and phantoms, other patients 0.2 to 0.5 where
// the anatomy differed.
inline constexpr double kMinSimilarity = 0.5, kRejectedSimilarity = 0.35;
// Each view; views in which a spine was chosen reached 0.55.
inline constexpr double kMinViewSimilarity = 0.4;

// Parts of a view that may match elsewhere. Right patients reached 3 of 77; others with skulls alike within a
// millimeter had 3 % of 150 and more. Parts overlap, so that one place counts up to four times.
inline constexpr double kMostPartsShare = 0.06, kMostPartsShareOfMany = 0.03, kMostParts = 3.0;
// What lies before and behind a chosen volume is seen in the X-ray only: there right patients reached 10 %.
inline constexpr double kMostPartsShareOfVolume = 0.15;
inline constexpr int kLeastParts = 2;

// Contradiction of the views, mm as root mean square over them, or sigmas. Undisturbed studies reached 0.05 to 0.22 mm
// (plastic head and chest, four kinds of views); a patient turned 2 degrees between the views, a gantry 2 or a receptor
// 1.5 degrees, a panel 3 mm or a distance 2 % off in one of them 0.68 mm and more (docs/evaluation.md).
inline constexpr double kMaxContradictionMm = 0.5, kMaxContradictionSigmas = 3.0;
// A turn between the views, rad or sigmas. Undisturbed and bent patients of the campaign wanted at most 0.6 degrees as
// wholes, a gantry angle that is 2 degrees wrong 1.0 to 3.1 (docs/algorithms.md, "Contradiction").
inline constexpr double kMostTurnRad = rad_from_deg(0.8), kMostTurnSigmas = 3.5;
// The share of what bodies explain that turned views explain. Right patients of the campaign whose breathing looked
// like a turn had at most 0.18; gantry angles that were 2 or 3 degrees wrong 0.47 and more.
inline constexpr double kMostByTurn = 0.3;
// What the rigid patient gains at a pose of its own in every view: in nats, and as a share of what bodies gain.
// Geometry that was wrong in one view, or a patient who moved between the views, gained 25 nats and more and 1.08 and
// more of what bodies gained (two of 33 that were right within 1 mm 0.77); right patients of the campaign 0.05 to 0.73.
inline constexpr double kLeastGainApart = 10.0, kMostShareApart = 0.9;

// Two sigma, at the target and of the rotation. What carries a target is small, and turns less surely than a whole
// patient; what counts is where the target's surface lies.
inline constexpr double kMaxTwoSigmaMm = 1.0, kMaxTwoSigmaRad = rad_from_deg(1.0);
inline constexpr double kMaxTwoSigmaRadOfBodies = rad_from_deg(2.0);

// Correlations near the target of bodies (TargetMatch). Other patients of the same kind, whose bones were free to
// follow, had at most 0.85 of all and 0.95 of parts, and 0.87 within 40 mm; real spines searched a vertebra off 0.76
// within 40 mm (docs/algorithms.md, "Bodies that bend").
inline constexpr double kLeastOfAll = 0.86, kLeastOfParts = 0.95, kLeastWithin40Mm = 0.9, kLeastWithin20Mm = 0.7;
// The share of the target that vertebrae carry, for it to count as theirs.
inline constexpr double kLeastByVertebrae = 0.8;
// Of vertebrae whose parts match: right chests had 0.84 and more, those searched a vertebra off at most 0.76, and a
// spinous process beside the end of the CT, found 2.3 mm off, 0.79.
inline constexpr double kLeastWithin40MmBesideParts = 0.8;
// Other bones are searched in groups, and a part of a group may have moved by itself. Targets on opened jaws, 2 to 6 mm
// off at the edge of a field, had 0.86 to 0.88 of all and 0.82 to 0.93 of parts; right ones on jaws 0.87 to 0.91 and
// 0.94 to 0.96, plastic heads 0.98 and 0.99.
inline constexpr double kLeastOfPartsOfGroups = 0.935;
// What a single bone wants, nothing confirms: a bone that is nearly straight fits as well where it has slid along.
inline constexpr int kMinDeterminedBones = 2;
inline constexpr double kMinImageShare = 0.3, kMaxDeformationMm = 2.0;

// An alternative must leave this many times as much unexplained (1 - gradient correlation) as the images as they are.
// On head phantoms, which are nearly symmetric, a mirrored AP view leaves 1.2 to 4 times as much.
inline constexpr double kAlternativeMargin = 1.1;

// Parts near the target, for bodies to be searched although nothing speaks against the whole. Jaws that had opened by 3
// to 5 degrees, with targets on them 2 mm off and more, always had a part next to the target that disagreed; of 273
// patients who were right 9 had.
inline constexpr double kPartsNearMm = 50.0, kPartsNextToMm = 30.0;
inline constexpr int kLeastPartsNear = 2, kOneDisagreesOf = 5;
// Coarse correlations near the target, likewise. Targets on jaws that had opened by 14 to 20 degrees had up to 0.70 and
// 0.89. Patients who were right, with metal near the target, had 0.54 and more, and all but four of 44 had 0.92 and
// more of parts. Coarse or noisy images match less everywhere, and cannot tell.
inline constexpr double kLeastNear = 0.86, kLeastPartsOfNear = 0.92, kLeastEverywhere = 0.9, kLessThanEverywhere = 0.04;

// Where the target's surroundings want it, against a chosen region. Right answers for regions of phantoms and of real
// CTs were wanted at most 0.4 mm elsewhere; answers that a bend had put 1.0 and 2.4 mm off, 0.5 and 2.4 mm.
inline constexpr double kMostFromRegionMm = 0.5;
// From the target's center to the edge of what a view shows, in mm at the isocenter. Targets 10 mm inside of a field's
// edge, on jaws that had opened, were accepted 3 mm off. Small fields of the campaign had 15 mm and more.
inline constexpr double kLeastInsideMm = 12.0;

// About one axis of the couch, where no site says from which rotation to act: more than most couches correct, and what
// a couch angle on another scale looks like (354 for 6 turns the answer by 12 degrees).
inline constexpr double kMostRotationDeg = 5.0;

}  // namespace isoshift::limits
