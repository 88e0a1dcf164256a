// tests/data/column_meshes.json: columns as they come over the wire, and what their meshes are. The
// TypeScript client's test reads the same file through WebAssembly.
//
// hash: FNV-1a, 32 bits, over positions (i32, 1/256), normals (3 x f32), colours (3 x u8), material
// ids (u8), parts (u8, 0 where there are none) and indices (u32), little endian, one behind the
// other. A hexadecimal chunk is in the form of CHUNK_FORMAT.md. When meshes are to change,
// the test that compares the file leaves the new one in the folder for temporary files.
#include "client-sample/cpp/column_map.h"
#include "generator/terrain/generate_stack.h"
#include "generator/volume/chunk_codec.h"
#include "protocol/base/bytes.h"
#include "tests/client/scripted_peer.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <span>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

namespace terrane {
namespace {

using Json = nlohmann::json;

class Fnv {
  public:
    template <typename T>
    void add(const std::vector<T>& values) {
        static_assert(std::is_trivially_copyable_v<T>);
        for (const std::byte byte : std::as_bytes(std::span(values))) {
            hash_ = (hash_ ^ std::to_integer<std::uint32_t>(byte)) * 16777619U;
        }
    }

    std::uint32_t hash() const { return hash_; }

  private:
    std::uint32_t hash_ = 2166136261U;
};

Json json_of(ChunkPos key, const Mesh& mesh) {
    std::vector<std::uint8_t> parts(mesh.vertex_count());
    for (std::size_t i = 0; i < parts.size(); ++i) {
        parts[i] = static_cast<std::uint8_t>(mesh.part(i));
    }
    Fnv fnv;
    fnv.add(mesh.positions256);
    fnv.add(mesh.normals);
    fnv.add(mesh.colors);
    fnv.add(mesh.material_ids);
    fnv.add(parts);
    fnv.add(mesh.indices);
    std::array<std::size_t, 3> triangles{};
    for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
        ++triangles.at(static_cast<std::size_t>(mesh.part_of_triangle(i)));
    }
    return {{"key", {key.lod, key.x, key.y, key.z}},
            {"vertices", mesh.vertex_count()},
            {"triangles", triangles},
            {"hash", fnv.hash()}};
}

ServerHello hello_of(const Json& json) {
    ServerHello hello = test_hello();
    hello.chunk_side = json.at("chunk_side");
    hello.chunk_height = json.at("chunk_height");
    hello.height_bound_voxels = json.at("height_bound_voxels");
    hello.levels = kLodMax + 1;
    hello.mesh_parts = json.at("mesh_parts");
    hello.materials.clear();
    for (const Json& material : json.at("materials")) {
        const auto kind = static_cast<MaterialKind>(material.at("kind").get<int>());
        hello.materials.push_back({.name = "",
                                   .color_rgb = material.at("color"),
                                   .texture = {},
                                   .solid = is_solid(kind),
                                   .kind = static_cast<WireMaterialKind>(kind)});
    }
    return hello;
}

ChunkPos key_of(const Json& json) {
    return {.lod = json.at(0), .x = json.at(1), .y = json.at(2), .z = json.at(3)};
}

Bytes bytes_of(const std::string& hex) {
    Bytes bytes;
    for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
        bytes.push_back(static_cast<std::byte>(std::stoi(hex.substr(i, 2), nullptr, 16)));
    }
    return bytes;
}

void put(ColumnMap& map, const Json& json) {
    ChunkAnswer answer;
    answer.key = key_of(json.at("key"));
    answer.format = ChunkFormat::columns;
    Bytes payload;
    if (json.contains("uniform")) {
        answer.status = ChunkStatus::uniform;
        for (const Json& share : json.at("uniform")) {
            answer.uniform.push_back({.material = share.at(0), .concentration = share.at(1)});
        }
    } else {
        payload = bytes_of(json.at("chunk"));
        payload.insert(payload.begin(), std::byte{0});  // plain
    }
    const auto taken = map.put(answer, payload);
    ASSERT_TRUE(taken) << taken.error().message;
}

TEST(ColumnVectors, MeshesAreThoseOfTheFile) {
    std::ifstream file(test_data_path("column_meshes.json"));
    const Json vectors = Json::parse(file);
    ColumnMap map(hello_of(vectors.at("world")));
    for (const Json& chunk : vectors.at("chunks")) {
        put(map, chunk);
    }
    std::array<std::size_t, 3> triangles{};
    for (const Json& expected : vectors.at("meshes")) {
        const ChunkPos key = key_of(expected.at("key"));
        const auto mesh = map.mesh(key);
        ASSERT_TRUE(mesh) << mesh.error().message;
        EXPECT_EQ(json_of(key, *mesh).dump(), expected.dump());
        for (std::size_t i = 0; i < triangles.size(); ++i) {
            triangles[i] += expected.at("triangles").at(i).get<std::size_t>();
        }
    }
    EXPECT_GT(*std::ranges::min_element(triangles), 10U);
}

std::string hex_of(const Bytes& bytes) {
    constexpr std::string_view kDigits = "0123456789abcdef";
    std::string text;
    for (const std::byte byte : bytes) {
        text += kDigits[std::to_integer<unsigned>(byte) >> 4U];
        text += kDigits[std::to_integer<unsigned>(byte) & 15U];
    }
    return text;
}

/// A stack's chunks, as a server says them.
void append_chunks(Json& chunks, const Stack& stack, std::int32_t heights, std::int32_t height) {
    for (std::int32_t y = 0; y < heights; ++y) {
        Chunk chunk;
        cut_chunk(chunk, stack, y, height);
        const StackPos at = stack.position;
        Json json = {{"key", {at.lod, at.x, y, at.z}}};
        if (chunk.uniform) {
            for (const Share& share : chunk.uniform_content.composition.shares()) {
                json["uniform"].push_back({share.material, share.concentration});
            }
        } else {
            Bytes bytes;
            encode_chunk(bytes, chunk, FlowPlane::without);
            json["chunk"] = hex_of(bytes);
        }
        chunks.push_back(std::move(json));
    }
}

/// Small chunks of `karst` around the first stack that has ground, caves and water, and a tile of
/// level 2 with water: what the test above reads.
TEST(ColumnVectors, TheFileIsWhatTheGeneratorGives) {
    WorldDefinition definition = load_shipped_world("karst")->definition;
    definition.grid.side = 8;
    definition.grid.height = 16;
    const auto world = World::build(definition);
    ASSERT_TRUE(world);
    const auto heights =
        static_cast<std::int32_t>(world->stack.height_bound) / definition.grid.height + 1;
    SurfaceNetsMesher mesher(definition);
    HeightFieldMesher tile_mesher(definition);
    StackGenerator generator(*world);
    Stack stack;
    const auto meshes_of = [&](StackPos at) {
        EXPECT_TRUE(generator.generate(stack, at));
        Json meshes = Json::array();
        for (std::int32_t y = 0; y < (at.lod == 0 ? heights : 1); ++y) {
            Mesh mesh;
            if (at.lod == 0) {
                mesher.mesh(mesh, stack, y, definition.grid.height);
            } else {
                tile_mesher.mesh(mesh, stack, true);
            }
            meshes.push_back(json_of({.lod = at.lod, .x = at.x, .y = y, .z = at.z}, mesh));
        }
        return meshes;
    };
    const auto has_all = [](const Json& meshes) {
        std::array<std::size_t, 3> triangles{};
        for (const Json& mesh : meshes) {
            for (std::size_t i = 0; i < triangles.size(); ++i) {
                triangles[i] += mesh.at("triangles").at(i).get<std::size_t>();
            }
        }
        return *std::ranges::min_element(triangles) > 40;
    };
    StackPos found{.lod = 0, .x = -20, .z = 0};
    while (!has_all(meshes_of(found))) {
        found.x = found.x < 60 ? found.x + 1 : -20;
        found.z += found.x == -20 ? 1 : 0;
        ASSERT_LT(found.z, 60);
    }
    StackPos tile{.lod = 2, .x = found.x >> 2, .z = found.z >> 2};
    while (meshes_of(tile)[0].at("triangles").at(2) < 10) {
        ASSERT_LT(++tile.x, 60);
    }
    Json chunks = Json::array();
    Json meshes = Json::array();
    for (const StackPos middle : {found, tile}) {
        for (Json& mesh : meshes_of(middle)) {
            meshes.push_back(std::move(mesh));
        }
        for (std::int32_t i = 0; i < 9; ++i) {
            ASSERT_TRUE(generator.generate(
                stack, {.lod = middle.lod, .x = middle.x - 1 + i % 3, .z = middle.z - 1 + i / 3}));
            append_chunks(chunks, stack, middle.lod == 0 ? heights : 1, definition.grid.height);
        }
    }
    Json materials = Json::array();
    for (const Material& material : definition.materials) {
        const Rgb8 color = material.color;
        materials.push_back({{"color", color.r << 16 | color.g << 8 | color.b},
                             {"kind", static_cast<int>(material.kind)}});
    }
    std::ostringstream file;
    file << R"({"world":)"
         << Json{{"chunk_side", definition.grid.side},
                 {"chunk_height", definition.grid.height},
                 {"height_bound_voxels", world->stack.height_bound},
                 {"mesh_parts", definition.has_landscape()},
                 {"materials", materials}}
         << ",\n\"chunks\":[";
    for (std::size_t i = 0; i < chunks.size(); ++i) {
        file << (i == 0 ? "\n" : ",\n") << chunks[i];
    }
    file << "],\n\"meshes\":[";
    for (std::size_t i = 0; i < meshes.size(); ++i) {
        file << (i == 0 ? "\n" : ",\n") << meshes[i];
    }
    file << "]}\n";
    std::ifstream kept(test_data_path("column_meshes.json"));
    const std::string text((std::istreambuf_iterator<char>(kept)), {});
    if (file.str() != text) {
        const auto path = std::filesystem::temp_directory_path() / "column_meshes.json";
        std::ofstream(path) << file.str();
        ADD_FAILURE() << "the file differs; as it would be now: " << path;
    }
}

}  // namespace
}  // namespace terrane
