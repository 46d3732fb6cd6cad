#include "io/network/orthanc.h"

#include <curl/curl.h>
#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace isoshift {
namespace {

constexpr long kConnectTimeoutS = 5, kStallS = 30, kStallBytesPerS = 1000, kOk = 200, kNotFound = 404;

std::size_t append(char* bytes, std::size_t size, std::size_t count, void* to) {
  static_cast<std::string*>(to)->append(bytes, size * count);
  return size * count;
}

// An identifier; it may become the name of a file. Throws Error for anything else.
std::string id_of(const nlohmann::json& one) {
  auto id = one.at("ID").get<std::string>();
  if (id.empty() || id.find_first_not_of("0123456789abcdef-") != std::string::npos)
    throw Error(fmt::format("Orthanc: {} is not an identifier of Orthanc", id));
  return id;
}

// What a server answered, as `read` has it. Throws Error where it is something else.
template <typename Read>
auto parsed(const std::string& body, const std::string& url, const char* expected, const Read& read) {
  try {
    return read(nlohmann::json::parse(body));
  } catch (const nlohmann::json::exception&) {
    throw Error(fmt::format("Orthanc at {}: answered something else than {}", url, expected));
  }
}

}  // namespace

RestOrthanc::RestOrthanc(OrthancServer server) : server_(std::move(server)), curl_(curl_easy_init()) {
  if (curl_ == nullptr) throw Error("HTTP is not available");
}

RestOrthanc::~RestOrthanc() { curl_easy_cleanup(curl_); }

RestOrthanc::Answer RestOrthanc::get(const std::string& path) const {
  Answer answer;
  curl_easy_reset(curl_);
  curl_easy_setopt(curl_, CURLOPT_URL, (server_.url + path).c_str());
  curl_easy_setopt(curl_, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(curl_, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(curl_, CURLOPT_CONNECTTIMEOUT, kConnectTimeoutS);
  curl_easy_setopt(curl_, CURLOPT_LOW_SPEED_TIME, kStallS);
  curl_easy_setopt(curl_, CURLOPT_LOW_SPEED_LIMIT, kStallBytesPerS);
  curl_easy_setopt(curl_, CURLOPT_WRITEFUNCTION, append);
  curl_easy_setopt(curl_, CURLOPT_WRITEDATA, &answer.body);
  if (!server_.user.empty()) {
    curl_easy_setopt(curl_, CURLOPT_USERNAME, server_.user.c_str());
    curl_easy_setopt(curl_, CURLOPT_PASSWORD, server_.password.c_str());
  }
  if (!server_.ca.empty()) curl_easy_setopt(curl_, CURLOPT_CAINFO, server_.ca.c_str());
  if (const CURLcode failed = curl_easy_perform(curl_); failed != CURLE_OK)
    throw ServerError(fmt::format("Orthanc at {}: {}", server_.url, curl_easy_strerror(failed)));
  curl_easy_getinfo(curl_, CURLINFO_RESPONSE_CODE, &answer.status);
  if (answer.status != kOk && answer.status != kNotFound)
    throw Error(fmt::format("Orthanc at {}: answered {} to {}{}", server_.url, answer.status, path,
                            answer.status == 401 ? "; user and password_file are wrong or missing" : ""));
  return answer;
}

Orthanc::Changes RestOrthanc::changes_since(std::int64_t last, int limit) const {
  const Answer answer = get(fmt::format("/changes?since={}&limit={}", last, limit));
  return parsed(answer.body, server_.url, "a list of changes", [](const nlohmann::json& json) {
    Changes changes{
        .instances = {}, .mark = "", .last = json.at("Last").get<std::int64_t>(), .done = json.at("Done").get<bool>()};
    for (const nlohmann::json& change : json.at("Changes")) {
      if (change.at("ChangeType") == "NewInstance") changes.instances.push_back(id_of(change));
      changes.mark = fmt::format("{} {}", change.at("ID").get<std::string>(), change.value("Date", ""));
    }
    return changes;
  });
}

std::string RestOrthanc::file_of(const std::string& instance) const {
  Answer answer = get("/instances/" + instance + "/file");
  return answer.status == kNotFound ? "" : std::move(answer.body);
}

std::vector<std::string> RestOrthanc::instances() const {
  return parsed(get("/instances").body, server_.url, "a list of instances",
                [](const nlohmann::json& json) { return json.get<std::vector<std::string>>(); });
}

std::vector<std::string> RestOrthanc::instances_beside(const std::string& instance) const {
  const Answer patient = get("/instances/" + instance + "/patient");
  if (patient.status == kNotFound) return {};
  const Answer all = get("/patients/" + parsed(patient.body, server_.url, "a patient", id_of) + "/instances");
  if (all.status == kNotFound) return {};
  return parsed(all.body, server_.url, "a list of instances", [](const nlohmann::json& json) {
    std::vector<std::string> instances;
    for (const nlohmann::json& one : json) instances.push_back(id_of(one));
    return instances;
  });
}

}  // namespace isoshift
