# The viewer: built by npm into client-sample/web/dist, which all presets share and where `terrane serve`
# of a build tree looks for it; installed into share/terrane/viewer.
option(TERRANE_VIEWER "Build the web viewer (node, npm, clang 19 for wasm32-wasi)" ON)
find_program(NPM npm)
find_program(CLANGXX_WASM clang++-19)
if(NOT TERRANE_VIEWER OR NOT NPM OR NOT CLANGXX_WASM OR NOT EXISTS /usr/lib/wasm32-wasi/libc++.a)
    message(STATUS "The viewer is not built: TERRANE_VIEWER, npm or clang 19 for wasm32-wasi is missing")
    return()
endif()
set(viewer ${CMAKE_SOURCE_DIR}/client-sample/web/dist)
file(GLOB_RECURSE viewer_sources CONFIGURE_DEPENDS
    client-sample/web/src/*.ts client-sample/web/src/*.css client-sample/typescript/src/*.ts
    client-sample/typescript/wasm/*.h client-sample/typescript/wasm/*.cpp
    generator/volume/*.h generator/volume/*.cpp generator/mesh/*.h generator/mesh/*.cpp)
list(FILTER viewer_sources EXCLUDE REGEX "/generated/|/node_modules/")
foreach(name web/index.html web/package.json web/package-lock.json web/tsconfig.json web/vite.config.ts
        web/build typescript/package.json typescript/package-lock.json typescript/tsconfig.json
        typescript/scripts/generate.mjs typescript/scripts/wasm.mjs typescript/wasm/build)
    list(APPEND viewer_sources ${CMAKE_SOURCE_DIR}/client-sample/${name})
endforeach()
add_custom_command(OUTPUT ${viewer}/index.html
    COMMAND ${CMAKE_SOURCE_DIR}/client-sample/web/build ${viewer}
    DEPENDS ${viewer_sources} ${CMAKE_SOURCE_DIR}/protocol/wire/terrane.fbs
    COMMENT "Building the viewer" VERBATIM)
add_custom_target(terrane_viewer DEPENDS ${viewer}/index.html)
add_dependencies(terrane terrane_viewer)
install(DIRECTORY ${viewer}/ DESTINATION share/terrane/viewer OPTIONAL)
