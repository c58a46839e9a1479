#pragma once

#ifdef KROT_WITH_OPENSSL
#include <array>
#include <cstddef>
#include <memory>
#include <new>

#include <openssl/evp.h>
#else
#include "krot/bridge/portable_sha256.h"
#endif

namespace krot {

#ifdef KROT_WITH_OPENSSL

// As PortableSha256, by OpenSSL. Throws std::bad_alloc.
class Sha256Stream {
 public:
  Sha256Stream() : context_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
    if (!context_ ||
        EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) != 1) {
      throw std::bad_alloc();
    }
  }

  void Append(const unsigned char* bytes, size_t size) {
    EVP_DigestUpdate(context_.get(), bytes, size);
  }

  std::array<unsigned char, 32> Finish() {
    std::array<unsigned char, 32> digest;
    EVP_DigestFinal_ex(context_.get(), digest.data(), nullptr);
    return digest;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

#else

using Sha256Stream = PortableSha256;

#endif

}  // namespace krot
