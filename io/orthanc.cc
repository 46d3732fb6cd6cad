#include "io/orthanc.h"

#include <curl/curl.h>
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "geometry/error.h"

namespace isoshift {
namespace {

constexpr long kConnectTimeoutS = 5, kTimeoutS = 60, kOk = 200, kNotFound = 404;

std::size_t append(char* bytes, std::size_t size, std::size_t count, void* to) {
  static_cast<std::string*>(to)->append(bytes, size * count);
  return size * count;
}

}  // namespace

Orthanc::Orthanc(OrthancServer server) : server_(std::move(server)), curl_(curl_easy_init()) {
  if (curl_ == nullptr) throw Error("HTTP is not available");
}

Orthanc::~Orthanc() { curl_easy_cleanup(curl_); }

Orthanc::Answer Orthanc::get(const std::string& path) const {
  Answer answer;
  curl_easy_reset(curl_);
  curl_easy_setopt(curl_, CURLOPT_URL, (server_.url + path).c_str());
  curl_easy_setopt(curl_, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(curl_, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(curl_, CURLOPT_CONNECTTIMEOUT, kConnectTimeoutS);
  curl_easy_setopt(curl_, CURLOPT_TIMEOUT, kTimeoutS);
  curl_easy_setopt(curl_, CURLOPT_WRITEFUNCTION, append);
  curl_easy_setopt(curl_, CURLOPT_WRITEDATA, &answer.body);
  if (!server_.user.empty()) {
    curl_easy_setopt(curl_, CURLOPT_USERNAME, server_.user.c_str());
    curl_easy_setopt(curl_, CURLOPT_PASSWORD, server_.password.c_str());
  }
  if (!server_.ca.empty()) curl_easy_setopt(curl_, CURLOPT_CAINFO, server_.ca.c_str());
  if (const CURLcode failed = curl_easy_perform(curl_); failed != CURLE_OK)
    throw Error(fmt::format("Orthanc at {}: {}", server_.url, curl_easy_strerror(failed)));
  curl_easy_getinfo(curl_, CURLINFO_RESPONSE_CODE, &answer.status);
  if (answer.status != kOk && answer.status != kNotFound)
    throw Error(fmt::format("Orthanc at {}: answered {} to {}{}", server_.url, answer.status, path,
                            answer.status == 401 ? "; user and password_file are wrong or missing" : ""));
  return answer;
}

Orthanc::Changes Orthanc::changes_since(std::int64_t last) const {
  const Answer answer = get(fmt::format("/changes?since={}&limit=200", last));
  try {
    const nlohmann::json json = nlohmann::json::parse(answer.body);
    Changes changes{.instances = {}, .last = json.at("Last").get<std::int64_t>(), .done = json.at("Done").get<bool>()};
    for (const nlohmann::json& change : json.at("Changes"))
      if (change.at("ChangeType") == "NewInstance") changes.instances.push_back(change.at("ID").get<std::string>());
    return changes;
  } catch (const nlohmann::json::exception&) {
    throw Error(fmt::format("Orthanc at {}: /changes answered something else than a list of changes", server_.url));
  }
}

std::string Orthanc::file_of(const std::string& instance) const {
  Answer answer = get("/instances/" + instance + "/file");
  return answer.status == kNotFound ? "" : std::move(answer.body);
}

}  // namespace isoshift
