// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/trajectory_text.h"
#include "tests/fuzz/fuzzing.h"

#include <cmath>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  if (size == 0) return 0;
  const size_t num_columns = 1 + data[0] % 16;
  return OnlyErrors([&] {
    for (const auto& row : ParseNumberRows(InputText(data + 1, size - 1), num_columns, "fuzz")) {
      Require(row.size() == num_columns);
      for (const double number : row) Require(std::isfinite(number));
    }
  });
}
