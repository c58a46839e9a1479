# krot_embed_page(<target>)
#
# Generates krot/report/html_page_template.h, which holds the report page with
# its style and scripts, for the sources of <target>.
function(krot_embed_page target)
  set(page_dir ${CMAKE_CURRENT_SOURCE_DIR}/page)
  set(include_dir ${CMAKE_CURRENT_BINARY_DIR}/generated)
  set(header ${include_dir}/krot/report/html_page_template.h)
  file(GLOB sources CONFIGURE_DEPENDS
    ${page_dir}/*.html ${page_dir}/*.css ${page_dir}/*.js)
  add_custom_command(
    OUTPUT ${header}
    COMMAND ${CMAKE_COMMAND} -DPAGE_DIR=${page_dir} -DHEADER=${header}
      -P ${page_dir}/bundle.cmake
    DEPENDS ${sources} ${page_dir}/bundle.cmake
    COMMENT "Bundling the report page"
    VERBATIM)
  target_sources(${target} PRIVATE ${header})
  target_include_directories(${target} PRIVATE ${include_dir})
endfunction()
