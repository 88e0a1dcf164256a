// Any bytes: decoding refuses them or gives a record that encodes and decodes to itself, and that
// everything which reads chunks and stacks can read.
#include "generator/mesh/blocky.h"
#include "generator/mesh/surface_nets.h"
#include "generator/volume/chunk.h"
#include "generator/volume/chunk_codec.h"
#include "generator/volume/voxel.h"
#include "protocol/base/check.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace {

void read_all(const terrane::Chunk& chunk) {
    for (std::int32_t z = 0; z < chunk.side; ++z) {
        for (std::int32_t x = 0; x < chunk.side; ++x) {
            TERRANE_ASSERT(voxel_of(chunk, x, chunk.height - 1, z).count > 0);
        }
    }
}

void read_all(const terrane::Stack& stack) {
    static constexpr std::int32_t kHeight = 8;
    static const terrane::WorldDefinition kDefinition = [] {
        terrane::WorldDefinition definition;
        definition.materials.resize(terrane::kMaterialsMax);
        return definition;
    }();
    static terrane::SurfaceNetsMesher smooth(kDefinition);
    static terrane::BlockyMesher blocks(kDefinition);
    terrane::Chunk chunk;
    terrane::Mesh mesh;
    const std::int32_t last = stack.position.lod > 0 ? 0 : 2;
    for (std::int32_t y = 0; y <= last; ++y) {
        cut_chunk(chunk, stack, y, kHeight);
        read_all(chunk);
        if (stack.position.lod == 0) {  // tiles of other levels have a mesher of their own
            smooth.mesh(mesh, stack, y, kHeight);
            blocks.mesh(mesh, stack, y, kHeight);
        }
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace terrane;
    const auto bytes = std::as_bytes(std::span(data, size));
    Bytes again;
    if (const auto chunk = decode_chunk(bytes)) {
        encode_chunk(again, *chunk);
        read_all(*chunk);
        const auto decoded = decode_chunk(again);
        TERRANE_ASSERT(decoded && *decoded == *chunk);
    }
    if (const auto stack = decode_stack(bytes)) {
        encode_stack(again, *stack);
        read_all(*stack);
        const auto decoded = decode_stack(again);
        TERRANE_ASSERT(decoded && *decoded == *stack);
    }
    return 0;
}
