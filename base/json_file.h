#pragma once
// JSON files that people write: every mistake is named with its file, its place and what is expected there.

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace isoshift {

struct JsonFile {
  nlohmann::json json;
  std::string text;    // of the file, as it is
  std::string sha256;  // of that, hexadecimal
};

// What the library says of a text that it cannot read, without its own name for that: "parse error at line 1, ...".
std::string reason_of(const nlohmann::json::exception& error);

// The text of a JSON file: indented, with a newline at the end. Names of files, and what files say, may hold bytes that
// are no UTF-8: they are replaced, never a reason to lose a result.
template <class Json>
std::string json_text(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

// Throws Error naming `where` for a text that is not JSON, or in which an object has a key twice.
nlohmann::json json_from(const std::string& text, const std::string& where);

// Throws Error for a file that cannot be read, or whose text does what json_from() refuses.
JsonFile read_json_file(const std::filesystem::path& path);

template <class T>
inline constexpr bool is_array = false;
template <class T, std::size_t N>
inline constexpr bool is_array<std::array<T, N>> = true;

// An object in such a file. The reader asks for every key that it knows; end() throws Error for any other key.
class JsonSection {
 public:
  // `where`: the file, and the place in it. The JSON must outlive the section.
  JsonSection(const nlohmann::json& json, std::string where);

  template <class T>
  std::optional<T> find(const char* key, const char* expected) {
    know(key);
    if (!json_.contains(key)) return std::nullopt;
    const nlohmann::json& value = json_.at(key);
    if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>)
      if (!value.is_number_integer()) refuse(key, expected);
    if constexpr (is_array<T>)
      if (!value.is_array() || value.size() != std::tuple_size_v<T>) refuse(key, expected);
    try {
      return value.get<T>();
    } catch (const nlohmann::json::exception&) {
      refuse(key, expected);
    }
  }
  template <class T>
  T required(const char* key, const char* expected) {
    if (auto value = find<T>(key, expected)) return *std::move(value);
    refuse_missing(key, expected);
  }
  std::optional<double> number(const char* key, double low, double high);
  // The object under a key; nothing if the key is missing.
  std::optional<JsonSection> section(const char* key);

  [[noreturn]] void refuse(const char* key, const char* expected) const;
  [[noreturn]] void refuse_missing(const char* key, const char* expected) const;
  const std::string& where() const { return where_; }
  void end() const;

 private:
  void know(const char* key);

  const nlohmann::json& json_;
  std::string where_;
  std::vector<std::string> known_;
};

}  // namespace isoshift
