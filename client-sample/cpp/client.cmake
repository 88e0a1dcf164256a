# The client: a library that games link (target terrane_client_library, installed as the package
# `terrane`), and terrane-client, the program that shows it. Only the program knows CLI11 and JSON.
terrane_library(terrane_client_library FOLDERS client-sample/cpp
    DEPENDS terrane_wire terrane_generator Boost::headers OpenSSL::SSL zstd::libzstd_shared)
terrane_library(terrane_client_program FOLDERS client-sample/cpp/program
    DEPENDS terrane_client_library CLI11::CLI11 nlohmann_json::nlohmann_json PNG::PNG
        OpenSSL::Crypto)
add_executable(terrane-client client-sample/cpp/program/main.cpp)
target_link_libraries(terrane-client PRIVATE terrane_client_program)
