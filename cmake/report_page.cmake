# vgtw_embed_report_page(TARGET): adds the parts of report.html to a target, see
# plugin/report_page_files.h. The 3D library is taken from Debian's package libjs-three; without it
# the page leaves its 3D view out.
function(vgtw_embed_report_page target)
  set(folder ${PROJECT_SOURCE_DIR}/plugin/report_page)
  set(page_js)
  foreach(name IN ITEMS util metrics charts views scene_model scene scene_box page)
    list(APPEND page_js ${folder}/${name}.js)
  endforeach()

  set(VGTW_THREE_DIR /usr/share/javascript/three CACHE PATH "Folder of three.js r111, for report.html")
  set(three_js ${VGTW_THREE_DIR}/build/three.min.js
               ${VGTW_THREE_DIR}/examples/js/controls/OrbitControls.js)
  foreach(file IN LISTS three_js)
    if(NOT EXISTS ${file})
      message(STATUS "report.html will have no 3D view: ${file} not found (package libjs-three)")
      set(three_js)
      break()
    endif()
  endforeach()

  set(output ${PROJECT_BINARY_DIR}/generated/plugin/report_page_files.cc)
  set(inputs ${folder}/page.html ${folder}/page.css ${page_js} ${three_js} ${folder}/three_licence.txt)
  list(JOIN page_js "," page_js)
  list(JOIN three_js "," three_js)
  add_custom_command(
    OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -DOUTPUT=${output} -DHEADER=plugin/report_page_files.h
            -DSPACE=report_page_files
            "-DENTRIES=page_html=${folder}/page.html|page_css=${folder}/page.css|page_js=${page_js}|three_js=${three_js}|three_licence=${folder}/three_licence.txt"
            -P ${PROJECT_SOURCE_DIR}/cmake/embed_files.cmake
    DEPENDS ${inputs} ${PROJECT_SOURCE_DIR}/cmake/embed_files.cmake
    COMMENT "Embedding the report page" VERBATIM)
  target_sources(${target} PRIVATE ${output})
endfunction()
