# SPDX-License-Identifier: BSD-3-Clause
# scripts/summarise_tests counts what a binary of GoogleTest ran, and believes neither a binary that
# ended in a test nor one that failed behind its tests.
string(ASCII 9 tab)
set(report ${BINARY_DIR}/summary.xml)
file(CONFIGURE OUTPUT ${report} @ONLY NEWLINE_STYLE LF CONTENT [[
<testsuite>
@tab@<testcase name="scene/a_test" classname="scene/a_test" time="1" status="run">
@tab@@tab@<system-out>Running main()
[ RUN      ] A.Passes
[       OK ] A.Passes (0 ms)
[ RUN      ] A.Lacks/0
a.cc:7: Skipped
photos are absent
[  SKIPPED ] A.Lacks/0 (0 ms)
progress 3 / 3[       OK ] of something else
[  PASSED  ] 1 test.
[  SKIPPED ] 1 test, listed below:
[  SKIPPED ] A.Lacks/0
@tab@@tab@</system-out>
@tab@</testcase>
@tab@<testcase name="scene/b_test" classname="scene/b_test" time="1" status="fail">
@tab@@tab@<failure message=""/>
@tab@@tab@<system-out>[ RUN      ] B.Fails
[  FAILED  ] B.Fails (0 ms)
[ RUN      ] B.Crashes
@tab@@tab@</system-out>
@tab@</testcase>
@tab@<testcase name="scene/c_test" classname="scene/c_test" time="1" status="fail">
@tab@@tab@<failure message=""/>
@tab@@tab@<system-out>[ RUN      ] C.Leaks
[       OK ] C.Leaks (0 ms)
@tab@@tab@</system-out>
@tab@</testcase>
@tab@<testcase name="network/d_test.Of/&quot;x&quot;" classname="d" time="1" status="run">
@tab@@tab@<system-out>[ RUN      ] D.Of/0
[       OK ] D.Of/0 (0 ms)
@tab@@tab@</system-out>
@tab@</testcase>
@tab@<testcase name="structure/e" classname="e" time="1" status="run">
@tab@@tab@<system-out/>
@tab@</testcase>
@tab@<testcase name="structure/f" classname="f" time="1" status="notrun">
@tab@@tab@<skipped message="SKIP_REGULAR_EXPRESSION_MATCHED"/>
@tab@@tab@<system-out>[  SKIPPED ] no tool
@tab@@tab@</system-out>
@tab@</testcase>
@tab@<testcase name="structure/g" classname="g" time="1" status="fail">
@tab@@tab@<system-out>broken
@tab@@tab@</system-out>
@tab@</testcase>
</testsuite>
]])

function(expect_summary require_data expected)
  execute_process(COMMAND ${CMAKE_COMMAND} -E env VGTW_REQUIRE_DATA=${require_data}
                          ${SOURCE_DIR}/scripts/summarise_tests ${report}
                  OUTPUT_VARIABLE found RESULT_VARIABLE code)
  if(NOT found STREQUAL expected OR code EQUAL 0)
    message(FATAL_ERROR "summarise_tests said (exit code ${code})\n${found}expected\n${expected}")
  endif()
endfunction()

set(failures "FAILED: scene/b_test.B.Fails
FAILED: scene/b_test.B.Crashes: did not end
FAILED: scene/c_test
FAILED: structure/g
")
expect_summary(0 "skipped: scene/a_test.A.Lacks/0: photos are absent
skipped: structure/f: no tool
${failures}4 passed, 4 failed, 2 skipped
")
expect_summary(1 "skipped: structure/f: no tool
FAILED: scene/a_test.A.Lacks/0: skipped: photos are absent
${failures}4 passed, 5 failed, 1 skipped
")
