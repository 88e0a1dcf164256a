// A world file small enough to know by line number: tests replace a line of it and see what is
// said.
#pragma once

#include "generator/world/world_file.h"

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace terrane::testing {

/// The lines; line n of the file is entry n - 1. A good world: void, base, limestone, gold, cave.
inline std::vector<std::string> small_world_lines() {
    return {
        "format = 1",                                    // 1
        "name = \"small\"",                              // 2
        "seed = 42",                                     // 3
        "[terrain]",                                     // 4
        "depth = 40",                                    // 5
        "scale = 28",                                    // 6
        "octaves = 1",                                   // 7
        "layer_thickness = 17.5",                        // 8
        "layer_similarity = 1.0",                        // 9
        "roughness = 10",                                // 10
        "vein_area = 24",                                // 11
        "cave_area = 24",                                // 12
        "vein_thickness = 10",                           // 13
        "cave_thickness = 10",                           // 14
        "vein_density = 0.25",                           // 15
        "cave_density = 0.25",                           // 16
        "[grid]",                                        // 17
        "chunk = [32, 16, 32]",                          // 18
        "plot = 160",                                    // 19
        "voxel_size_m = 1.0",                            // 20
        "[[material]]",                                  // 21
        "id = 0",                                        // 22
        "name = \"air\"",                                // 23
        "color = \"#cde4fa\"",                           // 24
        "kind = \"void\"",                               // 25
        "[[material]]",                                  // 26
        "id = 1",                                        // 27
        "name = \"granite\"",                            // 28
        "color = \"#3c3a42\"",                           // 29
        "kind = \"base\"",                               // 30
        "thickness = [0.3, 0.55, 0.8]",                  // 31
        "roughness = [0.2, 0.4, 0.6]",                   // 32
        "similarity = 0.5",                              // 33
        "blend = 0.5",                                   // 34
        "[[material]]",                                  // 35
        "id = 2",                                        // 36
        "name = \"limestone\"",                          // 37
        "color = \"#c4a470\"",                           // 38
        "kind = \"regular\"",                            // 39
        "depth = [0, 0.5, 1]",                           // 40
        "thickness = [0.3, 0.55, 0.8]",                  // 41
        "roughness = [0.2, 0.4, 0.7]",                   // 42
        "similarity = 0.4",                              // 43
        "blend = 0.3",                                   // 44
        "[[material]]",                                  // 45
        "id = 3",                                        // 46
        "name = \"gold\"",                               // 47
        "color = \"#FAD228\"",                           // 48
        "kind = \"vein\"",                               // 49
        "area = 0.9",                                    // 50
        "depth = [0, 0.5, 1]",                           // 51
        "thickness = [0.3, 0.5, 0.8]",                   // 52
        "roughness = [0.2, 0.45, 0.7]",                  // 53
        "blend = 0.2",                                   // 54
        "[[material]]",                                  // 55
        "id = 4",                                        // 56
        "name = \"cave\"",                               // 57
        "color = \"#140a1e\"",                           // 58
        "kind = \"cave\"",                               // 59
        "area = 0.9",                                    // 60
        "depth = [0, 0.5, 1]",                           // 61
        "thickness = [0.3, 0.5, 0.8]",                   // 62
        "roughness = [0.2, 0.45, 0.7]",                  // 63
        "[affinity]",                                    // 64
        "same_layer_default = 1.0",                      // 65
        "next_layer_default = 0.5",                      // 66
        "same_layer = [[\"limestone\", \"gold\", -1]]",  // 67
        "next_layer = []",                               // 68
    };
}

inline std::string joined(const std::vector<std::string>& lines) {
    std::string text;
    for (const std::string& line : lines) {
        text += line + "\n";
    }
    return text;
}

inline std::string small_world_text() {
    return joined(small_world_lines());
}

/// The small world with line `number` (from 1) replaced.
inline std::string small_world_with(std::size_t number, std::string_view line) {
    std::vector<std::string> lines = small_world_lines();
    lines.at(number - 1) = line;
    return joined(lines);
}

/// What is said of this text as the file w.toml.
inline std::vector<std::string> faults_of(std::string_view text) {
    std::vector<std::string> texts;
    for (const WorldFileFault& fault : parse_world_file(text, "w.toml", "").faults) {
        texts.push_back(fault.text());
    }
    return texts;
}

}  // namespace terrane::testing
