# The client: a library that games link (target terrane_client_library, installed as the package
# `terrane`), and terrane-client, the program that shows it. Only the program knows CLI11 and JSON.
terrane_library(terrane_client_library FOLDERS client-sample/cpp
    DEPENDS terrane_wire terrane_generator Boost::headers OpenSSL::SSL zstd::libzstd_shared)
terrane_library(terrane_client_program FOLDERS client-sample/cpp/program
    DEPENDS terrane_client_library CLI11::CLI11 nlohmann_json::nlohmann_json PNG::PNG
        OpenSSL::Crypto)
add_executable(terrane-client client-sample/cpp/program/main.cpp)
target_link_libraries(terrane-client PRIVATE terrane_client_program)

# cmake --install BUILD --prefix PREFIX --component client: the library as a package.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
install(TARGETS terrane_base terrane_wire terrane_generator terrane_client_library
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT client
    FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/terrane COMPONENT client-internals
        EXCLUDE_FROM_ALL)
# What terrane.h includes, and nothing else: no Boost, no FlatBuffers, no internals.
install(CODE "set(terrane_source \"${CMAKE_SOURCE_DIR}\")
    set(terrane_include \"${CMAKE_INSTALL_INCLUDEDIR}\")" COMPONENT client)
install(SCRIPT ${CMAKE_CURRENT_LIST_DIR}/package/install_headers.cmake COMPONENT client)
install(TARGETS terrane terrane-client RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT programs)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/package/terraneConfig.cmake.in
    ${CMAKE_BINARY_DIR}/package/terraneConfig.cmake
    INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/terrane
    PATH_VARS CMAKE_INSTALL_LIBDIR CMAKE_INSTALL_INCLUDEDIR)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/package/terraneConfigVersion.cmake
    COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/package/terraneConfig.cmake
    ${CMAKE_BINARY_DIR}/package/terraneConfigVersion.cmake COMPONENT client
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/terrane)
