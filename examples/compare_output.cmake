# cmake -DPROGRAM=... -DRECORDED=... -DWORK_DIR=... -P compare_output.cmake
# Runs an example in an empty folder and compares what it prints with what is recorded.
cmake_minimum_required(VERSION 3.25)

file(REMOVE_RECURSE ${WORK_DIR})
file(MAKE_DIRECTORY ${WORK_DIR})
execute_process(COMMAND ${PROGRAM} ${WORK_DIR} OUTPUT_VARIABLE printed RESULT_VARIABLE result)
file(READ ${RECORDED} recorded)
if(result OR NOT printed STREQUAL recorded)
  message(FATAL_ERROR "exit ${result}; printed:\n${printed}\nrecorded in ${RECORDED}:\n${recorded}")
endif()
