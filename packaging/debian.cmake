# The Debian packages: cpack --config build/release/CPackConfig.cmake. isoshift is the program, libisoshift-dev what other
# programs are built with, python3-isoshift the Python module.
install(FILES packaging/isoshift-watch.service packaging/isoshift-serve.service DESTINATION lib/systemd/system)
install(FILES packaging/isoshift.sysusers DESTINATION lib/sysusers.d RENAME isoshift.conf)
install(FILES packaging/watch.json packaging/site.json packaging/gpu.conf DESTINATION share/doc/isoshift/examples)
install(FILES README.md LICENSE CHANGELOG.md DESTINATION share/doc/isoshift)
install(DIRECTORY docs/ DESTINATION share/doc/isoshift/docs FILES_MATCHING PATTERN "*.md" PATTERN "*.json" PATTERN "*.png" PATTERN "*.svg")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_PACKAGE_CONTACT "The isoshift developers <isoshift@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL program development)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME isoshift)
# What no library names: the driver's finder, which is loaded when it is there, and a font.
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS "libegl1, fonts-dejavu-core")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/packaging/postinst)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "orthanc, slurm-client")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libisoshift-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "libcairo2-dev, libceres-dev, libcsv-dev, libdcmtk-dev, libeigen3-dev, libepoxy-dev, libfmt-dev, libglm-dev, libhwy-dev, \
libnlopt-cxx-dev, libnlopt-dev, libopencv-imgproc-dev, libopenjp2-7-dev, libpango1.0-dev, libseccomp-dev, libssl-dev, libtbb-dev, libtiff-dev, \
nlohmann-json3-dev, pkg-config, zlib1g-dev")
if(ISOSHIFT_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python)
  math(EXPR next_minor "${Python3_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-isoshift)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= ${Python3_VERSION_MAJOR}.${Python3_VERSION_MINOR}), python3 (<< \
${Python3_VERSION_MAJOR}.${next_minor}), python3-numpy, isoshift (= ${PROJECT_VERSION})")
endif()
set(CPACK_STRIP_FILES ON)
include(CPack)
