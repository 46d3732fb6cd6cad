# The Debian package: cpack --config build/release/CPackConfig.cmake
install(FILES packaging/isoshift-watch.service packaging/isoshift-serve.service DESTINATION lib/systemd/system)
install(FILES packaging/watch.json packaging/site.json packaging/gpu.conf DESTINATION share/doc/isoshift/examples)
install(FILES README.md LICENSE CHANGELOG.md DESTINATION share/doc/isoshift)
install(DIRECTORY docs/ DESTINATION share/doc/isoshift/docs FILES_MATCHING PATTERN "*.md" PATTERN "*.json")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_PACKAGE_CONTACT "The isoshift developers <isoshift@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# What no library names: the driver's finder, which is loaded when it is there, and a font.
set(CPACK_DEBIAN_PACKAGE_DEPENDS "libegl1, fonts-dejavu-core")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "orthanc, slurm-client")
set(CPACK_STRIP_FILES ON)
include(CPack)
