#include "serve/pam.h"

#include <security/pam_appl.h>

#include <cstdlib>
#include <cstring>

namespace isoshift {
namespace {

// Answers the question for the password, and no other.
int answer(int count, const pam_message** questions, pam_response** answers, void* password) {
  if (count <= 0 || count > PAM_MAX_NUM_MSG) return PAM_CONV_ERR;
  auto* list = static_cast<pam_response*>(std::calloc(static_cast<std::size_t>(count), sizeof(pam_response)));
  if (list == nullptr) return PAM_BUF_ERR;
  for (int n = 0; n < count; ++n) {
    if (questions[n]->msg_style == PAM_PROMPT_ECHO_OFF) list[n].resp = ::strdup(static_cast<const char*>(password));
    if (questions[n]->msg_style == PAM_PROMPT_ECHO_ON) list[n].resp = ::strdup("");
  }
  *answers = list;  // PAM frees it
  return PAM_SUCCESS;
}

}  // namespace

bool is_password_of(const std::string& service, const std::string& user, const std::string& password) {
  std::string kept = password;
  const pam_conv conversation{.conv = answer, .appdata_ptr = kept.data()};
  pam_handle_t* pam = nullptr;
  if (::pam_start(service.c_str(), user.c_str(), &conversation, &pam) != PAM_SUCCESS) return false;
  int status = ::pam_authenticate(pam, PAM_SILENT | PAM_DISALLOW_NULL_AUTHTOK);
  if (status == PAM_SUCCESS) status = ::pam_acct_mgmt(pam, PAM_SILENT | PAM_DISALLOW_NULL_AUTHTOK);
  ::pam_end(pam, status);
  ::explicit_bzero(kept.data(), kept.size());
  return status == PAM_SUCCESS;
}

}  // namespace isoshift
