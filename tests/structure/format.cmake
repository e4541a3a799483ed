# cmake -DSOURCE_DIR=... [-DCLANG_FORMAT=/path] -P format.cmake
# Every C++ file begins with its licence and is formatted by .clang-format.
include(${CMAKE_CURRENT_LIST_DIR}/common.cmake)

vgtw_source_files(files)
foreach(file IN LISTS files)
  file(STRINGS ${SOURCE_DIR}/${file} first_line LIMIT_COUNT 1)
  if(NOT first_line STREQUAL "// SPDX-License-Identifier: BSD-3-Clause")
    vgtw_fault("${file}: the first line is not the SPDX licence line")
  endif()
endforeach()
vgtw_report_faults()

# Other versions format differently, so that they would complain about everything.
if(NOT CLANG_FORMAT)
  message("[  SKIPPED ] clang-format-14 is not installed")
  return()
endif()
execute_process(COMMAND ${CLANG_FORMAT} --dry-run -Werror ${files}
                WORKING_DIRECTORY ${SOURCE_DIR} RESULT_VARIABLE result ERROR_VARIABLE complaints)
if(result)
  string(REGEX MATCHALL "[^\n]*: error:[^\n]*" lines "${complaints}")
  list(TRANSFORM lines REPLACE ":[0-9]+: error:.*" "")
  list(REMOVE_DUPLICATES lines)
  list(JOIN lines "\n  " text)
  message(FATAL_ERROR "mend with `clang-format-14 -i FILE`:\n  ${text}")
endif()
