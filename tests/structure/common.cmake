# What the checks share. SOURCE_DIR is the root of the tree.
cmake_minimum_required(VERSION 3.25)

# vgtw_source_files(list) sets `list` to every C++ file of the project, as relative paths.
function(vgtw_source_files list)
  set(files)
  foreach(folder IN ITEMS scene network matching bridge refine evaluation plugin examples tests)
    file(GLOB_RECURSE found RELATIVE ${SOURCE_DIR} ${SOURCE_DIR}/${folder}/*.h
         ${SOURCE_DIR}/${folder}/*.cc)
    list(APPEND files ${found})
  endforeach()
  if(NOT files)
    message(FATAL_ERROR "no source files below ${SOURCE_DIR}")
  endif()
  set(${list} ${files} PARENT_SCOPE)
endfunction()

# Notes something that is wrong; the check goes on.
function(vgtw_fault text)
  set_property(GLOBAL APPEND_STRING PROPERTY VGTW_FAULTS "\n  ${text}")
endfunction()

# Fails the check if anything was wrong.
function(vgtw_report_faults)
  get_property(faults GLOBAL PROPERTY VGTW_FAULTS)
  if(faults)
    message(FATAL_ERROR "${faults}")
  endif()
endfunction()
