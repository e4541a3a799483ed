# What find_package(vgtw) finds after `cmake --install`.

include(CMakePackageConfigHelpers)

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/vgtw)
configure_package_config_file(
  ${CMAKE_CURRENT_LIST_DIR}/vgtwConfig.cmake.in ${PROJECT_BINARY_DIR}/vgtwConfig.cmake
  INSTALL_DESTINATION ${package_folder} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/vgtwConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/vgtwConfig.cmake ${PROJECT_BINARY_DIR}/vgtwConfigVersion.cmake
        DESTINATION ${package_folder})
