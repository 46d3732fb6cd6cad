# isoshift_library(NAME SOURCE...): a static library isoshift_NAME, a box of ARCHITECTURE.md. isoshift_light_library() makes
# one that visits no pixels and no voxels.
#
# Headers that most sources include are compiled once for all boxes, and up to 26 sources of a box are compiled together
# (CMAKE_UNITY_BUILD in the presets); bench/results/build-time.md has what that saves. So the anonymous namespaces of a
# box hold no name twice; the few sources where they do are compiled by themselves. Each test file has a namespace of its
# own. Sources include what they use all the same: ./dev lint reads each by itself, without either.
option(ISOSHIFT_PCH "Precompile the headers that most sources include" ON)
set(CMAKE_UNITY_BUILD_BATCH_SIZE 26)

set(isoshift_common_headers
    <algorithm> <array> <chrono> <cmath> <filesystem> <fstream> <functional> <map> <memory> <optional> <set> <span> <string>
    <string_view> <utility> <vector> <Eigen/Geometry> <fmt/format.h> <fmt/ranges.h> <nlohmann/json.hpp>)

# isoshift_precompiled: for what computes, with the flags of the build. isoshift_precompiled_light: for what reads, decides
# and writes, with -O1, which compiles a third faster and whose time to run nobody notices; not with -Og: of a template
# that such a box shares with one that computes, the linker may keep its slow copy (bench/results/build-time.md). GCC
# takes a header only with the flags that it was precompiled with.
file(WRITE ${PROJECT_BINARY_DIR}/precompiled.cc "")
add_library(isoshift_light INTERFACE)
target_compile_options(isoshift_light INTERFACE $<$<CONFIG:Release,RelWithDebInfo>:-O1>)
if(ISOSHIFT_PCH)
  foreach(kind "" _light)
    add_library(isoshift_precompiled${kind} OBJECT ${PROJECT_BINARY_DIR}/precompiled.cc)
    target_link_libraries(isoshift_precompiled${kind} PUBLIC isoshift_common isoshift_flags)
    target_precompile_headers(isoshift_precompiled${kind} PRIVATE ${isoshift_common_headers})
  endforeach()
  target_link_libraries(isoshift_precompiled_light PRIVATE isoshift_light)
endif()

function(isoshift_library_with precompiled name)
  add_library(isoshift_${name} STATIC ${ARGN})
  target_link_libraries(isoshift_${name} PUBLIC isoshift_common $<BUILD_INTERFACE:isoshift_flags>)
  if(ISOSHIFT_PCH)
    target_precompile_headers(isoshift_${name} REUSE_FROM ${precompiled})
  endif()
endfunction()

function(isoshift_library name)
  isoshift_library_with(isoshift_precompiled ${name} ${ARGN})
endfunction()

function(isoshift_light_library name)
  isoshift_library_with(isoshift_precompiled_light ${name} ${ARGN})
  target_link_libraries(isoshift_${name} PRIVATE $<BUILD_INTERFACE:isoshift_light>)
endfunction()

# isoshift_precompile(TARGET HEADER...): for a target with headers of its own beside the common ones.
function(isoshift_precompile target)
  if(ISOSHIFT_PCH)
    target_precompile_headers(${target} PRIVATE ${isoshift_common_headers} ${ARGN})
  endif()
endfunction()
