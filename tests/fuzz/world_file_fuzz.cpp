// Any text as a world file: faults, or a definition whose canonical form means the same.
#include "generator/world/world_file.h"
#include "protocol/base/check.h"

#include <cstddef>
#include <cstdint>
#include <string_view>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace terrane;
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    const WorldFileResult result = parse_world_file(text, "fuzz.toml", "/nonexistent");
    for (const WorldFileFault& fault : result.faults) {
        TERRANE_ASSERT(fault.line >= 1 && fault.column >= 1 && !fault.message.empty());
    }
    if (result.ok()) {
        const std::string canonical = canonical_world_file(result.definition);
        const WorldFileResult again = parse_world_file(canonical, "canonical", "/nonexistent");
        TERRANE_ASSERT(again.ok());
        TERRANE_ASSERT(world_fingerprint(again.definition) == world_fingerprint(result.definition));
    }
    return 0;
}
