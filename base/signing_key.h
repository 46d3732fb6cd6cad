#pragma once
// Signatures of texts: Ed25519 (RFC 8032).

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

struct evp_pkey_st;  // of OpenSSL

namespace isoshift {

class SigningKey {
 public:
  // A private key, PEM, as `openssl genpkey -algorithm ed25519` writes it. Throws Error for a file that cannot be read,
  // that other users can read, or that holds no such key.
  explicit SigningKey(const std::filesystem::path& path);

  std::string sign(std::string_view text) const;  // base64
  bool has_signed(std::string_view text, const std::string& signature) const;

 private:
  std::shared_ptr<evp_pkey_st> key_;
};

// A new private key, PEM. Throws Error if none can be made.
std::string new_signing_key();

}  // namespace isoshift
