// SPDX-License-Identifier: BSD-3-Clause
// Folders of an import, and what it says.
#pragma once

#include "bridge/import.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>
#include <string>

#include <gtest/gtest.h>

namespace vgtw {

struct ImportCase {
  explicit ImportCase(const std::string& input_name) : input(folder / input_name) {}

  void Write(const std::string& name, const std::string& bytes) const {
    WriteFileAtomically(input / name, bytes);
  }
  ImportSummary Run(const ImportOptions& options = {}) const {
    return Import(input, photos, output, options);
  }
  // Of the error, which leaves no output; "" if there is none.
  std::string Message(const ImportOptions& options = {}) const {
    try {
      Run(options);
    } catch (const Error& error) {
      EXPECT_FALSE(std::filesystem::exists(output));
      return error.what();
    }
    return "";
  }

  TemporaryFolder folder;
  std::filesystem::path photos = folder / "photos";
  std::filesystem::path input;
  std::filesystem::path output = folder / "out";
};

inline void ExpectHas(const std::string& message, const std::string& part) {
  EXPECT_NE(message.find(part), std::string::npos) << message;
}

}  // namespace vgtw
