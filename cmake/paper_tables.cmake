# vgtw_embed_paper_tables(TARGET): adds plugin/paper_tables.json to a target, see plugin/paper_tables.h.
function(vgtw_embed_paper_tables target)
  set(input ${PROJECT_SOURCE_DIR}/plugin/paper_tables.json)
  set(output ${PROJECT_BINARY_DIR}/generated/plugin/paper_tables_json.cc)
  add_custom_command(
    OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -DOUTPUT=${output} -DHEADER=plugin/paper_tables.h -DSPACE=paper_files
            "-DENTRIES=tables_json=${input}" -P ${PROJECT_SOURCE_DIR}/cmake/embed_files.cmake
    DEPENDS ${input} ${PROJECT_SOURCE_DIR}/cmake/embed_files.cmake
    COMMENT "Embedding the paper's tables" VERBATIM)
  target_sources(${target} PRIVATE ${output})
endfunction()
