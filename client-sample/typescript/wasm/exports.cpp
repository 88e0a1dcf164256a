// What JavaScript calls: one room of columns behind plain functions. The caller copies bytes into
// memory from room_buffer(), and reads results at the addresses that the getters give, before the
// next call. Numbers of results: -1 is an error, whose message is at room_error().
#include "client-sample/typescript/wasm/column_room.h"
#include "client-sample/typescript/wasm/section.h"
#include "generator/mesh/mesh_world.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#define TERRANE_EXPORT(name) extern "C" __attribute__((export_name(#name)))

namespace {

using namespace terrane;

/// What a caller may ask a buffer for: a decompressed chunk is at most this large.
constexpr std::size_t kBufferBytesMax = std::size_t{64} << 20U;

struct Room {
    std::unique_ptr<ColumnRoom> columns;
    std::vector<std::byte> buffer;
    std::string error;
    Mesh mesh;
    std::vector<float> positions;
    SectionPixels section;
    std::vector<double> palette;
    std::vector<Limit> column;
};

Room& room() {
    static Room the_room;
    return the_room;
}

int failed(const Error& error) {
    room().error = error.message;
    return -1;
}

int result_of(const Result<bool>& result) {
    return result ? (*result ? 1 : 0) : failed(result.error());
}

}  // namespace

/// Room for `bytes` of input; null if that is too much.
TERRANE_EXPORT(room_buffer) void* room_buffer(std::size_t bytes) {
    if (bytes > kBufferBytesMax) {
        return nullptr;
    }
    room().buffer.resize(std::max<std::size_t>(bytes, 1));
    return room().buffer.data();
}

TERRANE_EXPORT(room_error) const char* room_error() {
    return room().error.c_str();
}

/// The buffer holds r, g, b and the kind (as on the wire) a material. `mesh_parts` as in the
/// greeting.
TERRANE_EXPORT(room_open)

int room_open(int side, int height, int heights, int materials, int mesh_parts) {
    Room& here = room();
    if (side < kChunkSideMin || side > kChunkSideMax || height < kChunkSideMin ||
        height > kChunkSideMax || heights < 1 || heights > kHeightBoundMax || materials < 1 ||
        materials > static_cast<int>(kMaterialsMax) ||
        here.buffer.size() < std::size_t{4} * static_cast<std::size_t>(materials)) {
        return failed({.code = ErrorCode::out_of_range, .message = "columns: no such world"});
    }
    std::vector<Material> read;
    for (std::size_t i = 0; i < static_cast<std::size_t>(materials); ++i) {
        const auto channel = [&](std::size_t at) {
            return std::to_integer<std::uint8_t>(here.buffer[4 * i + at]);
        };
        Material material;
        material.id = static_cast<std::int64_t>(i);
        material.color = {.r = channel(0), .g = channel(1), .b = channel(2)};
        material.kind = channel(3) <= static_cast<std::uint8_t>(MaterialKind::water)
                            ? static_cast<MaterialKind>(channel(3))
                            : MaterialKind::regular;
        read.push_back(std::move(material));
    }
    WorldDefinition world = mesh_world(std::move(read), mesh_parts != 0);
    world.grid.side = side;
    world.grid.height = height;
    here.columns = std::make_unique<ColumnRoom>(std::move(world), heights);
    return 0;
}

/// The buffer holds a chunk. 1: its stack is complete now, 0: not yet.
TERRANE_EXPORT(room_put) int room_put(std::size_t bytes) {
    Room& here = room();
    return result_of(
        here.columns->put(std::span(here.buffer).first(std::min(bytes, here.buffer.size()))));
}

/// The buffer holds `shares` pairs of doubles: material, concentration. kind as PaletteKind.
TERRANE_EXPORT(room_put_uniform)

int room_put_uniform(int lod, int x, int y, int z, int kind, int shares) {
    Room& here = room();
    PaletteEntry content;
    content.kind = static_cast<PaletteKind>(std::clamp(kind, 0, 3));
    for (int i = 0; i < std::min(shares, static_cast<int>(kCompositionMaterialsMax)); ++i) {
        double pair[2] = {0, 0};
        std::memcpy(pair, here.buffer.data() + sizeof(pair) * static_cast<std::size_t>(i),
                    sizeof(pair));
        if (!(pair[0] >= 0 &&
              pair[0] < static_cast<double>(here.columns->world().materials.size()))) {
            return failed({.code = ErrorCode::malformed, .message = "columns: no such material"});
        }
        content.composition.add(static_cast<std::uint16_t>(pair[0]), pair[1]);
    }
    return result_of(here.columns->put_uniform({.lod = lod, .x = x, .y = y, .z = z}, content));
}

TERRANE_EXPORT(room_drop) void room_drop(int lod, int x, int z) {
    room().columns->drop({.lod = lod, .x = x, .z = z});
}

TERRANE_EXPORT(room_has) int room_has(int lod, int x, int z) {
    return room().columns->find({.lod = lod, .x = x, .z = z}) != nullptr ? 1 : 0;
}

TERRANE_EXPORT(room_stacks) std::size_t room_stacks() {
    return room().columns->stack_count();
}

TERRANE_EXPORT(room_bytes) std::size_t room_bytes() {
    return room().columns->column_bytes();
}

/// Vertices, or -1 if the stack is not complete. Positions are floats, in columns of the level
/// along x and z and in voxels along y, relative to the stack's corner and `y_first`.
TERRANE_EXPORT(room_mesh)

int room_mesh(int lod, int x, int z, int what, int y_first, int y_last) {
    Room& here = room();
    if (!here.columns->mesh(here.mesh, {.lod = lod, .x = x, .z = z},
                            static_cast<MeshOf>(std::clamp(what, 0, 2)),
                            {.first = y_first, .last = std::max(y_first, y_last)})) {
        return failed({.code = ErrorCode::not_found, .message = "columns: the stack is not here"});
    }
    here.positions.clear();
    for (const auto& position : here.mesh.positions256) {
        for (int axis = 0; axis < 3; ++axis) {
            here.positions.push_back(static_cast<float>(position[axis]) / 256.0F);
        }
    }
    return static_cast<int>(here.mesh.vertex_count());
}

TERRANE_EXPORT(mesh_indices_count) std::size_t mesh_indices_count() {
    return room().mesh.indices.size();
}

TERRANE_EXPORT(mesh_positions) const void* mesh_positions() {
    return room().positions.data();
}

TERRANE_EXPORT(mesh_normals) const void* mesh_normals() {
    return room().mesh.normals.data();
}

TERRANE_EXPORT(mesh_colors) const void* mesh_colors() {
    return room().mesh.colors.data();
}

TERRANE_EXPORT(mesh_materials) const void* mesh_materials() {
    return room().mesh.material_ids.data();
}

/// A MeshPart each; null if all is ground.
TERRANE_EXPORT(mesh_parts) const void* mesh_parts() {
    return room().mesh.parts.empty() ? nullptr : room().mesh.parts.data();
}

TERRANE_EXPORT(mesh_indices) const void* mesh_indices() {
    return room().mesh.indices.data();
}

TERRANE_EXPORT(room_section)

void room_section(double x0, double z0, double x1, double z1, double y0, double y1, int width,
                  int height) {
    draw_section(room().section, *room().columns,
                 {.x0 = x0,
                  .z0 = z0,
                  .x1 = x1,
                  .z1 = z1,
                  .y0 = y0,
                  .y1 = y1,
                  .width = std::clamp(width, 0, 8192),
                  .height = std::clamp(height, 0, 8192)});
}

TERRANE_EXPORT(section_colors) const void* section_colors() {
    return room().section.colors.data();
}

TERRANE_EXPORT(section_contents) const void* section_contents() {
    return room().section.contents.data();
}

/// The limits of a column: 12 bytes each: y256 i32, palette id u16, flow 3 x i8. 0: unknown.
TERRANE_EXPORT(room_column) std::size_t room_column(double x, double z) {
    const auto column =
        room().columns->column_at(static_cast<std::int64_t>(x), static_cast<std::int64_t>(z));
    room().column.assign(column.begin(), column.end());
    return column.size();
}

TERRANE_EXPORT(column_limits) const void* column_limits() {
    static_assert(sizeof(Limit) == 12 && offsetof(Limit, palette_id) == 4 &&
                  offsetof(Limit, flow) == 6);
    return room().column.data();
}

/// A whole stack: side x side + 1 offsets, and limits as above. Null if it is not complete.
TERRANE_EXPORT(stack_offsets) const void* stack_offsets(int lod, int x, int z) {
    const HeldStack* const stack = room().columns->find({.lod = lod, .x = x, .z = z});
    return stack == nullptr ? nullptr : stack->columns.offsets.data();
}

TERRANE_EXPORT(stack_limits) const void* stack_limits(int lod, int x, int z) {
    const HeldStack* const stack = room().columns->find({.lod = lod, .x = x, .z = z});
    return stack == nullptr ? nullptr : stack->columns.limits.data();
}

/// The palette as doubles: for each entry kind, alone, count, then material and concentration
/// `count` times. Gives the number of doubles.
TERRANE_EXPORT(palette_doubles) std::size_t palette_doubles() {
    auto& out = room().palette;
    out.clear();
    for (const PaletteEntry& entry : room().columns->palette()) {
        out.push_back(static_cast<double>(entry.kind));
        out.push_back(entry.alone ? 1.0 : 0.0);
        out.push_back(entry.composition.count);
        for (const Share& share : entry.composition.shares()) {
            out.push_back(share.material);
            out.push_back(share.concentration);
        }
    }
    return out.size();
}

TERRANE_EXPORT(palette_data) const void* palette_data() {
    return room().palette.data();
}
