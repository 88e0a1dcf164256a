#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "protocol/base/check.h"

#include <string_view>

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
        case MaterialKind::soil:
            return "soil";
        case MaterialKind::sand:
            return "sand";
        case MaterialKind::snow:
            return "snow";
        case MaterialKind::water:
            return "water";
    }
    TERRANE_ASSERT(false);
    return {};
}

MaterialKeys keys_of(MaterialKind kind, bool alone) {
    MaterialKeys keys = {.area = false,
                         .depth = true,
                         .thickness = true,
                         .roughness = true,
                         .similarity = false,
                         .blend = !alone};
    switch (kind) {
        case MaterialKind::void_:
        case MaterialKind::soil:
        case MaterialKind::sand:
        case MaterialKind::snow:
        case MaterialKind::water:
            return {};
        case MaterialKind::base:  // makes the first layer, whose choice ignores depth
            keys.depth = false;
            keys.similarity = true;
            keys.hardness = true;
            return keys;
        case MaterialKind::regular:
            keys.similarity = true;
            keys.hardness = true;
            return keys;
        case MaterialKind::vein:
            keys.area = true;
            return keys;
        case MaterialKind::cave:
            keys.area = true;
            keys.blend = false;
            return keys;
    }
    TERRANE_ASSERT(false);
    return {};
}

}  // namespace terrane
