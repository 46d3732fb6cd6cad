#pragma once
// The record of a run of isoshift track: trace.csv, track.json, trace.svg, and the same in words.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "geometry/motion_sample.h"
#include "registration/motion/tracker.h"
#include "workflow/track/xray_stream.h"

namespace isoshift {

struct TraceRow {
  TrackedFrame frame;
  double processing_s = 0.0;  // from reading its pixels to the prediction
};

struct TrackRecord {
  TrackingOptions tracking;
  double budget_s = 0.2;  // moments that take longer are counted
  std::optional<double> tolerance_mm;
  std::vector<MotionSample> truth;  // empty: unknown

  std::size_t imagers = 0;
  std::vector<TraceRow> rows;  // by time
  std::vector<double> late_s;  // acquisition times of X-rays that arrived too late to be used
  StreamCounts files;
};

// Precondition of all functions: there are rows.
nlohmann::ordered_json track_json(const TrackRecord& record);
std::string trace_csv(const TrackRecord& record);
std::string trace_svg(const TrackRecord& record);             // of the axis with the largest motion
std::string track_text(const nlohmann::ordered_json& track);  // of track_json()

}  // namespace isoshift
