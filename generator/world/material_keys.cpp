#include "generator/world/world_file.h"
#include "protocol/base/check.h"

namespace terrane {

std::string_view to_string(MaterialKind kind) {
    switch (kind) {
        case MaterialKind::void_:
            return "void";
        case MaterialKind::base:
            return "base";
        case MaterialKind::regular:
            return "regular";
        case MaterialKind::vein:
            return "vein";
        case MaterialKind::cave:
            return "cave";
    }
    TERRANE_ASSERT(false);
    return {};
}

MaterialKeys keys_of(MaterialKind kind) {
    switch (kind) {
        case MaterialKind::void_:
            return {};
        case MaterialKind::base:  // makes the first layer, whose choice ignores depth
            return {.thickness = true, .roughness = true, .similarity = true, .blend = true};
        case MaterialKind::regular:
            return {.depth = true,
                    .thickness = true,
                    .roughness = true,
                    .similarity = true,
                    .blend = true};
        case MaterialKind::vein:
            return {
                .area = true, .depth = true, .thickness = true, .roughness = true, .blend = true};
        case MaterialKind::cave:
            return {.area = true, .depth = true, .thickness = true, .roughness = true};
    }
    TERRANE_ASSERT(false);
    return {};
}

}  // namespace terrane
