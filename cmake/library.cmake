# isoshift_library(NAME SOURCE...): a static library isoshift_NAME, a box of ARCHITECTURE.md.
function(isoshift_library name)
  add_library(isoshift_${name} STATIC ${ARGN})
  target_link_libraries(isoshift_${name} PUBLIC isoshift_common)
endfunction()
