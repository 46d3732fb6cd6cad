# find_package(isoshift) for other programs: isoshift::geometry, isoshift::drr, isoshift::registration and isoshift::io,
# which is all of io/ but the network and the report (tests/consumer).
include(CMakePackageConfigHelpers)
add_library(isoshift_io INTERFACE)
target_link_libraries(isoshift_io INTERFACE isoshift_objects)
set(isoshift_exported common base geometry setup bodies drr registration dicom config study objects io)
foreach(box ${isoshift_exported})
  set_target_properties(isoshift_${box} PROPERTIES EXPORT_NAME ${box})
  install(TARGETS isoshift_${box} EXPORT isoshift ARCHIVE DESTINATION lib/isoshift COMPONENT development)
endforeach()
set(package_files lib/cmake/isoshift)
install(EXPORT isoshift NAMESPACE isoshift:: FILE isoshift-targets.cmake DESTINATION ${package_files} COMPONENT development)
write_basic_package_version_file(isoshift-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES cmake/isoshift-config.cmake cmake/dependencies.cmake cmake/opencv.cmake
        ${PROJECT_BINARY_DIR}/isoshift-config-version.cmake DESTINATION ${package_files} COMPONENT development)
# OpenCV is no part of the interface.
set(on_opencv)
foreach(header field_edges field_sides leaf_outline mat small_field)
  list(APPEND on_opencv PATTERN "preprocess/${header}.h" EXCLUDE)
endforeach()
foreach(box base geometry setup bodies drr registration io/dicom io/config io/study io/objects)
  install(DIRECTORY ${box}/ DESTINATION include/isoshift/${box} COMPONENT development FILES_MATCHING PATTERN "*.h"
          ${on_opencv})
endforeach()
install(FILES ${PROJECT_BINARY_DIR}/base/version.h DESTINATION include/isoshift/base COMPONENT development)
