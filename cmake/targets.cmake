# Helpers that keep every folder's CMakeLists.txt to its list of files and links.

function(vgtw_compile_options target)
  target_compile_options(${target} PRIVATE -Wall -Wextra $<$<BOOL:${VGTW_WERROR}>:-Werror>)
  if(VGTW_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${VGTW_SANITIZE} -fno-sanitize-recover=all
                                             -fno-omit-frame-pointer)
    if(VGTW_BUILD_FUZZERS)
      target_compile_options(${target} PRIVATE
        -fsanitize-coverage-ignorelist=${PROJECT_SOURCE_DIR}/tests/fuzz/uncovered.txt)
    endif()
    # Under a sanitizer Eigen would free otherwise than the unsanitized libceres allocates.
    target_compile_definitions(${target} PRIVATE EIGEN_MALLOC_ALREADY_ALIGNED=1)
    target_link_options(${target} PUBLIC -fsanitize=${VGTW_SANITIZE})
  endif()
endfunction()

# vgtw_precompile(TARGET HEADER...) or (TARGET REUSE_FROM OTHER), with VGTW_PRECOMPILE only: what nearly
# every source includes is parsed once, which halves the time to compile. Not by default, because a
# missing #include then goes unnoticed (doors are verified without) and ccache has to be told
# (scripts/build).
function(vgtw_precompile target)
  if(NOT VGTW_PRECOMPILE)
    return()
  elseif(ARGV1 STREQUAL "REUSE_FROM")
    target_precompile_headers(${target} REUSE_FROM ${ARGV2})
  else()
    target_precompile_headers(${target} PRIVATE
      <Eigen/Geometry> <algorithm> <array> <cmath> <filesystem> <fstream> <functional> <map>
      <optional> <random> <set> <span> <sstream> <string> <unordered_map> <vector> ${ARGN})
    # What ccache asks of GCC's.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
  endif()
endfunction()

# vgtw_add_library(scene HEADERS a.h ... SOURCES a.cc ... [PUBLIC lib ...] [PRIVATE lib ...]
#                  [PRECOMPILE <header> ...])
# makes vgtw::scene, which is also the component `scene` of the installed package.
# HEADERS are the folder's doors: they are installed, must stand alone and include nothing heavy.
function(vgtw_add_library name)
  cmake_parse_arguments(ARG "" "" "HEADERS;SOURCES;PUBLIC;PRIVATE;PRECOMPILE" ${ARGN})
  set(target vgtw_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(vgtw::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} VERIFY_INTERFACE_HEADER_SETS ON)
  target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR} FILES
                                  ${ARG_HEADERS})
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  vgtw_compile_options(${target})
  vgtw_precompile(${target} ${ARG_PRECOMPILE})
  set_property(GLOBAL APPEND PROPERTY VGTW_COMPONENTS ${name})
  install(TARGETS ${target} EXPORT vgtw_${name}
          FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/vgtw)
  install(EXPORT vgtw_${name} NAMESPACE vgtw:: FILE vgtw_${name}.cmake
          DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/vgtw)
endfunction()
