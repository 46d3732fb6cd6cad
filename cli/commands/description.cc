#include "cli/commands/description.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <utility>

namespace isoshift {
namespace {

struct RemarkNames {
  std::string_view in_text, in_json;
};
constexpr std::array<RemarkNames, 5> kRemarkNames = {
    {{"note", "note"}, {"profile", "profile"}, {"CHECK", "check"}, {"MISSING", "missing"}, {"REFUSED", "refused"}}};

std::string line(std::string_view name, std::string_view value) { return fmt::format("  {:<24} {}\n", name, value); }

template <class Vector>
std::string text_of(const std::optional<Vector>& value, std::string_view unit) {
  return value ? fmt::format("({:.6g}) {}", fmt::join(*value, ", "), unit) : "missing";
}

}  // namespace

std::string or_missing(const std::optional<double>& value, std::string_view unit) {
  return value ? fmt::format("{:.6g} {}", *value, unit) : "missing";
}
std::string or_missing(const std::optional<Eigen::Vector3d>& value, std::string_view unit) {
  return text_of(value, unit);
}
std::string or_missing(const std::optional<std::string>& value) { return value ? *value : "missing"; }

Description::Description(std::string_view kind, std::string_view label, std::string_view place)
    : text_(fmt::format("{}{}, {}\n", kind, label.empty() ? "" : fmt::format(" \"{}\"", label), place)),
      json_({{"type", kind}, {"path", place}, {"label", label}, {"remarks", Json::array()}}) {}

void Description::add(std::string_view name, std::string_view key, const std::optional<double>& value,
                      std::string_view unit, std::string_view if_missing) {
  show(name, key, json_value(value), value ? or_missing(value, unit) : std::string(if_missing));
}
void Description::add(std::string_view name, std::string_view key, const std::optional<std::string>& value) {
  show(name, key, json_value(value), or_missing(value));
}
void Description::add(std::string_view name, std::string_view key, const std::optional<Eigen::Vector2d>& value,
                      std::string_view unit) {
  show(name, key, json_value(value), text_of(value, unit));
}
void Description::add(std::string_view name, std::string_view key, const std::optional<Eigen::Vector3d>& value,
                      std::string_view unit) {
  show(name, key, json_value(value), text_of(value, unit));
}

void Description::show(std::string_view name, std::string_view key, Json value, std::string_view text) {
  text_ += line(name, text);
  json_[key] = std::move(value);
}

void Description::append(std::string_view name, std::string_view list, Json value, std::string_view text) {
  text_ += line(name, text);
  json_[list].push_back(std::move(value));
}

void Description::remark(Remark remark, std::string_view text) {
  const RemarkNames& names = kRemarkNames.at(static_cast<std::size_t>(remark));
  text_ += line(names.in_text, text);
  json_["remarks"].push_back({{"kind", names.in_json}, {"text", text}});
}

}  // namespace isoshift
