// Worlds of tests/data and generator/worlds, built.
#pragma once

#include "generator/terrain/world.h"
#include "generator/world/world_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>

namespace terrane {

inline std::filesystem::path test_data_path(const std::string& name) {
    return std::filesystem::path(TERRANE_SOURCE_DIR) / "tests/data" / name;
}

/// The world of a file; the test fails and gets null if it is not one.
inline std::shared_ptr<const World> load_world_at(const std::filesystem::path& path) {
    WorldFileResult file = load_world_file(path);
    for (const WorldFileFault& fault : file.faults) {
        ADD_FAILURE() << fault.text();
    }
    auto world = World::build(std::move(file.definition));
    if (!world) {
        ADD_FAILURE() << path << ": " << world.error().message;
        return nullptr;
    }
    return std::make_shared<const World>(std::move(*world));
}

/// `name` without ".toml", of tests/data.
inline std::shared_ptr<const World> load_test_world(const std::string& name) {
    return load_world_at(test_data_path(name + ".toml"));
}

/// `name` without ".toml", of generator/worlds.
inline std::shared_ptr<const World> load_shipped_world(const std::string& name) {
    return load_world_at(std::filesystem::path(TERRANE_SOURCE_DIR) / "generator/worlds" /
                         (name + ".toml"));
}

}  // namespace terrane
