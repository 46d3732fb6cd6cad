#pragma once
// What `inspect` says of a file: lines for people, and the same as JSON.

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isoshift {

class Description {
 public:
  using Json = nlohmann::ordered_json;
  // "check": a person may allow it; "missing": a switch may supply it; "refused": neither helps.
  enum class Remark { kNote, kProfile, kCheck, kMissing, kRefused };

  // `kind` as people name it ("RT Image"), which JSON has as `type`; `place`: a file, or a folder.
  Description(std::string_view kind, std::string_view label, std::string_view place);

  // A line, and the value behind it; of JSON null where there is none.
  void add(std::string_view name, std::string_view key, const std::optional<double>& value, std::string_view unit,
           std::string_view if_missing = "missing");
  void add(std::string_view name, std::string_view key, const std::optional<std::string>& value);
  void add(std::string_view name, std::string_view key, const std::optional<Eigen::Vector2d>& value,
           std::string_view unit);
  void add(std::string_view name, std::string_view key, const std::optional<Eigen::Vector3d>& value,
           std::string_view unit);
  void show(std::string_view name, std::string_view key, Json value, std::string_view text);
  // The same of one of several things of a kind, which JSON has in a list.
  void append(std::string_view name, std::string_view list, Json value, std::string_view text);
  void remark(Remark remark, std::string_view text);

  const std::string& text() const { return text_; }
  const Json& json() const { return json_; }

 private:
  std::string text_;
  Json json_;
};

// As lines show them: "1000 mm", "(1, 2, 3) mm", "missing"; and as JSON has them.
std::string or_missing(const std::optional<double>& value, std::string_view unit);
std::string or_missing(const std::optional<Eigen::Vector3d>& value, std::string_view unit);
std::string or_missing(const std::optional<std::string>& value);

template <class Value>
Description::Json json_value(const std::optional<Value>& value) {
  if (!value) return {};
  return *value;
}
template <int kSize>
Description::Json json_value(const Eigen::Vector<double, kSize>& value) {
  return std::vector<double>(value.begin(), value.end());
}
template <int kSize>
Description::Json json_value(const std::optional<Eigen::Vector<double, kSize>>& value) {
  return value ? json_value(*value) : Description::Json();
}

}  // namespace isoshift
