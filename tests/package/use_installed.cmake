# cmake -DBUILD_DIR=... -DSOURCE_DIR=... -DWORK_DIR=... -P use_installed.cmake
# Installs the build into an empty prefix, builds examples/find_package against it as an outside
# project would, and compares what it prints with what is recorded beside it.
cmake_minimum_required(VERSION 3.25)

set(example ${SOURCE_DIR}/examples/find_package)
file(REMOVE_RECURSE ${WORK_DIR})

function(run)
  execute_process(COMMAND ${ARGN} OUTPUT_VARIABLE output ERROR_VARIABLE output
                  RESULT_VARIABLE result)
  if(result)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nfailed with ${result}:\n${output}")
  endif()
endfunction()

run(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${WORK_DIR}/prefix)
run(${CMAKE_COMMAND} -G Ninja -S ${example} -B ${WORK_DIR}/build -DCMAKE_BUILD_TYPE=Release
    -DCMAKE_PREFIX_PATH=${WORK_DIR}/prefix)
run(${CMAKE_COMMAND} --build ${WORK_DIR}/build)

execute_process(COMMAND ${WORK_DIR}/build/model_quality ${example}/model
                OUTPUT_VARIABLE printed RESULT_VARIABLE result)
file(READ ${example}/model_quality.txt recorded)
if(result OR NOT printed STREQUAL recorded)
  message(FATAL_ERROR "exit ${result}; printed:\n${printed}\nrecorded:\n${recorded}")
endif()

# The installed program must run from where it is, too.
run(${WORK_DIR}/prefix/bin/vgtw --version)
