// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/base64.h"

#include "scene/error.h"

#include <limits>

#include <openssl/evp.h>

namespace vgtw {

std::string Base64(std::span<const std::byte> bytes) {
  VGTW_CHECK(bytes.size() <= std::numeric_limits<int>::max() / 2, "too many bytes for base64");
  // One more for the NUL that is written behind.
  std::string text(4 * ((bytes.size() + 2) / 3) + 1, '\0');
  EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                  reinterpret_cast<const unsigned char*>(bytes.data()),
                  static_cast<int>(bytes.size()));
  text.pop_back();
  return text;
}

}  // namespace vgtw
