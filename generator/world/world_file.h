// World files: TOML in, a checked WorldDefinition or every fault at once out. See WORLD_FILE.md.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "generator/world/world_definition.h"
#include "protocol/base/hash.h"

namespace terrane {

/// One thing wrong in a world file; line and column count from 1.
struct WorldFileFault {
    std::string file;
    int line = 0;
    int column = 0;
    std::string key;
    std::string message;  ///< what is wrong, what is allowed

    /// "file:line:column: key: message"
    std::string text() const;
};

/// Either `faults` is empty and `definition` is whole, or `faults` has everything that is wrong.
struct WorldFileResult {
    WorldDefinition definition;
    std::vector<WorldFileFault> faults;

    bool ok() const { return faults.empty(); }
};

inline constexpr std::size_t kWorldFileBytesMax = std::size_t{1} << 20U;

/// Reads the file and its textures (names relative to its folder).
WorldFileResult load_world_file(const std::filesystem::path& path);

/// Parses text as if it were the file `name`; textures are looked for in `texture_folder`.
WorldFileResult parse_world_file(std::string_view text, std::string_view name,
                                 const std::filesystem::path& texture_folder);

/// The canonical world file: parsed values in a fixed order, comments and spacing gone. Parsing it
/// gives the same definition and the same fingerprint.
std::string canonical_world_file(const WorldDefinition& definition);

/// XXH3-128 of the canonical form, the textures' bytes and the generator version.
Hash128 world_fingerprint(const WorldDefinition& definition);

}  // namespace terrane
