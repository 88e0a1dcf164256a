#include "generator/mesh/glb.h"

#include "generator/mesh/draco_codec.h"
#include "generator/mesh/height_field.h"
#include "generator/mesh/mesh.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"

#include <draco/attributes/point_attribute.h>
#include <draco/compression/config/compression_shared.h>
#include <draco/compression/expert_encode.h>
#include <draco/core/encoder_buffer.h>
#include <draco/mesh/mesh.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr int kNormalBits = 8;
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinChunk = 0x004E4942;
constexpr std::string_view kEmptyJson =
    R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"name":"empty"}]})";

/// A vertex as the file has it. All bytes of it are values: it may be hashed as it lies.
struct GlbVertex {
    std::array<float, 3> position{};
    std::array<float, 3> normal{};
    std::array<std::uint8_t, 4> color{};

    friend bool operator==(const GlbVertex& a, const GlbVertex& b) {
        // No padding, and bits are what counts.
        // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison)
        return std::memcmp(&a, &b, sizeof(GlbVertex)) == 0;
    }
};

static_assert(sizeof(GlbVertex) == 28);

struct GlbVertexHash {
    std::size_t operator()(const GlbVertex& vertex) const {
        return std::hash<std::string_view>{}(
            {reinterpret_cast<const char*>(&vertex), sizeof(vertex)});
    }
};

struct GlbMesh {
    std::vector<GlbVertex> vertices;  ///< no two are equal
    std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// The centre of the settings' box in the mesh's own units; a multiple of 1/2.
std::array<float, 3> centre_of(const DracoSettings& settings) {
    const float side = static_cast<float>(settings.side) / 2;
    return {side, static_cast<float>(settings.height_voxels) / 2 - 1, side};
}

bool is_inside(const Mesh& mesh, const DracoSettings& settings) {
    const std::int32_t side256 = settings.side * 256;
    const std::int32_t top256 = (settings.height_voxels - 1) * 256;
    return std::all_of(mesh.positions256.begin(), mesh.positions256.end(),
                       [side256, top256](const glm::i32vec3& p) {
                           return p.x >= 0 && p.x <= side256 && p.z >= 0 && p.z <= side256 &&
                                  p.y >= -256 && p.y <= top256;
                       });
}

GlbVertex vertex_of(const Mesh& mesh, std::size_t i, const std::array<float, 3>& centre) {
    GlbVertex vertex;
    const auto at = [&](int axis) {
        const std::int32_t rounded = rounded_to_draco_step(mesh.positions256[i][axis]);
        // + 0: a coordinate may come out as -0, which is another value to who compares bytes.
        return static_cast<float>(rounded) / 256.0F - centre[static_cast<std::size_t>(axis)] + 0.0F;
    };
    vertex.position = {at(0), at(1), at(2)};
    const glm::vec3& normal = mesh.normals[i];
    vertex.normal = {normal.x + 0.0F, normal.y + 0.0F, normal.z + 0.0F};
    const glm::u8vec3& color = mesh.colors[i];
    vertex.color = {color.x, color.y, color.z, 255};
    return vertex;
}

/// One part's triangles. Vertices are numbered by their first use in one, so none is without.
GlbMesh merged(const Mesh& mesh, const DracoSettings& settings, MeshPart part) {
    const std::array<float, 3> centre = centre_of(settings);
    GlbMesh out;
    std::unordered_map<GlbVertex, std::uint32_t, GlbVertexHash> known;
    known.reserve(mesh.vertex_count());
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
        if (mesh.part_of_triangle(i / 3) != part) {
            continue;
        }
        std::array<GlbVertex, 3> corners;
        for (std::size_t corner = 0; corner < 3; ++corner) {
            corners[corner] = vertex_of(mesh, mesh.indices[i + corner], centre);
        }
        if (corners[0].position == corners[1].position ||
            corners[1].position == corners[2].position ||
            corners[2].position == corners[0].position) {
            continue;
        }
        std::array<std::uint32_t, 3> triangle{};
        for (std::size_t corner = 0; corner < 3; ++corner) {
            const auto [place, is_new] =
                known.try_emplace(corners[corner], static_cast<std::uint32_t>(out.vertices.size()));
            if (is_new) {
                out.vertices.push_back(corners[corner]);
            }
            triangle[corner] = place->second;
        }
        out.triangles.push_back(triangle);
    }
    return out;
}

/// Adds an attribute whose values are `member` of the vertices; gives its id.
template <typename T, std::size_t kComponents>
int add_attribute(draco::Mesh& out, std::span<const GlbVertex> vertices,
                  std::array<T, kComponents> GlbVertex::* member,
                  draco::GeometryAttribute::Type type, draco::DataType data_type) {
    auto attribute = std::make_unique<draco::PointAttribute>();
    attribute->Init(type, static_cast<std::int8_t>(kComponents), data_type,
                    data_type == draco::DT_UINT8, vertices.size());
    T* values = reinterpret_cast<T*>(attribute->buffer()->data());
    for (const GlbVertex& vertex : vertices) {
        values = std::copy((vertex.*member).begin(), (vertex.*member).end(), values);
    }
    return out.AddAttribute(std::move(attribute));
}

struct DracoPart {
    MeshPart part = MeshPart::ground;
    std::array<float, 3> least{};
    std::array<float, 3> most{};
    Bytes bytes;
    std::size_t points = 0;
    std::size_t triangles = 0;
    std::uint32_t position_id = 0;  ///< unique ids within the Draco mesh
    std::uint32_t normal_id = 0;
    std::uint32_t color_id = 0;
};

Result<DracoPart> draco_part(const GlbMesh& mesh, const DracoSettings& settings) {
    using Attribute = draco::GeometryAttribute;
    draco::Mesh filled;
    filled.set_num_points(static_cast<std::uint32_t>(mesh.vertices.size()));
    const int position = add_attribute(filled, mesh.vertices, &GlbVertex::position,
                                       Attribute::POSITION, draco::DT_FLOAT32);
    const int normal = add_attribute(filled, mesh.vertices, &GlbVertex::normal, Attribute::NORMAL,
                                     draco::DT_FLOAT32);
    const int color =
        add_attribute(filled, mesh.vertices, &GlbVertex::color, Attribute::COLOR, draco::DT_UINT8);
    filled.SetNumFaces(mesh.triangles.size());
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        const auto& [a, b, c] = mesh.triangles[i];
        filled.SetFace(draco::FaceIndex(i),
                       {draco::PointIndex(a), draco::PointIndex(b), draco::PointIndex(c)});
    }
    draco::ExpertEncoder encoder(filled);
    encoder.SetSpeedOptions(settings.speed, settings.speed);
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
    encoder.SetTrackEncodedProperties(true);
    const int bits = draco_position_bits(settings);
    const std::array<float, 3> centre = centre_of(settings);
    const std::array<float, 3> origin = {-centre[0], -1 - centre[1], -centre[2]};
    // (2^b - 1) / 32 is exact, so Draco's own step, range / (2^b - 1), is exactly 1/32.
    const float range = static_cast<float>((1 << bits) - 1) / kDracoStepsPerVoxel;
    encoder.SetAttributeExplicitQuantization(position, bits, 3, origin.data(), range);
    encoder.SetAttributeQuantization(normal, kNormalBits);
    draco::EncoderBuffer buffer;
    if (const draco::Status status = encoder.EncodeToBuffer(&buffer); !status.ok()) {
        return fail(ErrorCode::internal, "draco cannot encode " +
                                             std::to_string(mesh.triangles.size()) +
                                             " triangles: " + status.error_msg_string());
    }
    const auto encoded = std::as_bytes(std::span(buffer.data(), buffer.size()));
    std::array<float, 3> least = mesh.vertices.front().position;
    std::array<float, 3> most = least;
    for (const GlbVertex& vertex : mesh.vertices) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            least[axis] = std::min(least[axis], vertex.position[axis]);
            most[axis] = std::max(most[axis], vertex.position[axis]);
        }
    }
    return DracoPart{.part = MeshPart::ground,
                     .least = least,
                     .most = most,
                     .bytes = Bytes(encoded.begin(), encoded.end()),
                     .points = encoder.num_encoded_points(),
                     .triangles = encoder.num_encoded_faces(),
                     .position_id = filled.attribute(position)->unique_id(),
                     .normal_id = filled.attribute(normal)->unique_id(),
                     .color_id = filled.attribute(color)->unique_id()};
}

/// The shortest text that reads back as the same number: the same on every machine.
template <typename T>
std::string number(T value) {
    std::array<char, 64> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value);
    return {text.data(), end.ptr};
}

template <typename T>
std::string numbers(const std::array<T, 3>& values) {
    std::string text("[");
    text += number(values[0]);
    text += ',';
    text += number(values[1]);
    text += ',';
    text += number(values[2]);
    text += ']';
    return text;
}

constexpr std::size_t padded4(std::size_t size_bytes) {
    return (size_bytes + 3) & ~std::size_t{3};
}

void write_chunk(Bytes& out, std::uint32_t kind, std::span<const std::byte> content, char padding) {
    ByteWriter writer(out);
    const std::size_t size_bytes = padded4(content.size());
    writer.fixed(static_cast<std::uint32_t>(size_bytes));
    writer.fixed(kind);
    writer.raw(content);
    for (std::size_t i = content.size(); i < size_bytes; ++i) {
        out.push_back(static_cast<std::byte>(padding));
    }
}

Bytes glb_of(std::string_view json, std::span<const std::byte> binary) {
    constexpr std::uint32_t kMagic = 0x46546C67;
    constexpr std::uint32_t kVersion = 2;
    constexpr std::size_t kHeadBytes = 12;
    constexpr std::size_t kChunkHeadBytes = 8;
    const std::size_t size_bytes = kHeadBytes + kChunkHeadBytes + padded4(json.size()) +
                                   (binary.empty() ? 0 : kChunkHeadBytes + padded4(binary.size()));
    Bytes out;
    out.reserve(size_bytes);
    ByteWriter writer(out);
    writer.fixed(kMagic);
    writer.fixed(kVersion);
    writer.fixed(static_cast<std::uint32_t>(size_bytes));
    write_chunk(out, kJsonChunk, bytes_of(json), ' ');
    if (!binary.empty()) {
        write_chunk(out, kBinChunk, binary, '\0');
    }
    return out;
}

/// Ground and caves share a material; water is one that lets the bed shine through.
constexpr std::string_view kMaterials =
    R"({"pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":1}})";
constexpr std::string_view kWaterMaterial =
    R"({"name":"water","alphaMode":"BLEND","pbrMetallicRoughness":{"metallicFactor":0,)"
    R"("roughnessFactor":0.15,"baseColorFactor":[1,1,1,0.72]}})";

std::string_view name_of(MeshPart part) {
    return part == MeshPart::water ? "water" : part == MeshPart::cave ? "caves" : "ground";
}

/// What a scene's mesh has of one part: its primitive, its accessors, its place in the buffer.
struct PartJson {
    std::string primitive;
    std::string accessors;
    std::string buffer_view;
};

// componentType 5126 is float, 5121 u8, 5125 u32. Accessors have no bufferView: Draco has the
// values.
PartJson json_of(const DracoPart& part, std::size_t index, std::size_t offset_bytes,
                 bool is_named) {
    const std::string count = number(part.points);
    const std::size_t first = 4 * index;
    PartJson out;
    out.primitive =
        R"({"attributes":{"POSITION":)" + number(first) + R"(,"NORMAL":)" + number(first + 1) +
        R"(,"COLOR_0":)" + number(first + 2) + R"(},"indices":)" + number(first + 3) +
        R"(,"material":)" + (part.part == MeshPart::water && index > 0 ? "1" : "0") +
        R"(,"extensions":{"KHR_draco_mesh_compression":{"bufferView":)" + number(index) +
        R"(,"attributes":{"POSITION":)" + number(part.position_id) + R"(,"NORMAL":)" +
        number(part.normal_id) + R"(,"COLOR_0":)" + number(part.color_id) + "}}}";
    if (is_named) {
        out.primitive += R"(,"extras":{"part":")";
        out.primitive += name_of(part.part);
        out.primitive += R"("})";
    }
    out.primitive += "}";
    out.accessors = R"({"componentType":5126,"count":)" + count + R"(,"type":"VEC3","min":)" +
                    numbers(part.least) + R"(,"max":)" + numbers(part.most) +
                    R"(},{"componentType":5126,"count":)" + count +
                    R"(,"type":"VEC3"},{"componentType":5121,"normalized":true,"count":)" + count +
                    R"(,"type":"VEC4"},{"componentType":5125,"count":)" +
                    number(3 * part.triangles) + R"(,"type":"SCALAR"})";
    out.buffer_view = R"({"buffer":0,)";
    if (offset_bytes > 0) {
        out.buffer_view += R"("byteOffset":)" + number(offset_bytes) + ",";
    }
    out.buffer_view += R"("byteLength":)" + number(part.bytes.size()) + "}";
    return out;
}

/// The whole file of these parts; at least one. A lone part of ground has no extras.
Bytes glb_of_parts(std::span<const DracoPart> parts, const DracoSettings& settings,
                   const GlbPlace& place) {
    const std::array<float, 3> centre = centre_of(settings);
    Vector3 translation{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        translation[axis] =
            place.corner_m[axis] + static_cast<double>(centre[axis]) * place.unit_m[axis];
    }
    const bool is_named = parts.size() > 1 || parts.front().part != MeshPart::ground;
    PartJson all;
    Bytes binary;
    std::string materials(kMaterials);
    for (std::size_t i = 0; i < parts.size(); ++i) {
        binary.resize(padded4(binary.size()));
        const PartJson one = json_of(parts[i], i, binary.size(), is_named);
        const std::string comma = i > 0 ? "," : "";
        all.primitive += comma + one.primitive;
        all.accessors += comma + one.accessors;
        all.buffer_view += comma + one.buffer_view;
        binary.insert(binary.end(), parts[i].bytes.begin(), parts[i].bytes.end());
        if (parts[i].part == MeshPart::water) {
            if (i > 0) {
                materials += ',';
            } else {
                materials.clear();  // all is water
            }
            materials += kWaterMaterial;
        }
    }
    const std::string json =
        R"({"asset":{"generator":"Terrane","version":"2.0"},)"
        R"("extensionsUsed":["KHR_draco_mesh_compression"],)"
        R"("extensionsRequired":["KHR_draco_mesh_compression"],)"
        R"("scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"translation":)" +
        numbers(translation) + R"(,"scale":)" + numbers(place.unit_m) +
        R"(}],"meshes":[{"primitives":[)" + all.primitive + R"(]}],"materials":[)" + materials +
        R"(],"accessors":[)" + all.accessors + R"(],"bufferViews":[)" + all.buffer_view +
        R"(],"buffers":[{"byteLength":)" + number(binary.size()) + "}]}";
    return glb_of(json, binary);
}

/// A side of the tile: its plane, and the way in which an edge on it runs that has the solid below.
struct Side {
    int axis = 0;
    std::int32_t at256 = 0;
    int along = 0;
    std::int32_t direction = 0;
};

bool has_solid_below(const Side& side, const glm::i32vec3& a, const glm::i32vec3& b) {
    return a[side.axis] == side.at256 && b[side.axis] == side.at256 &&
           (b[side.along] - a[side.along]) * side.direction > 0;
}

struct Edge {
    std::uint32_t a = 0;
    std::uint32_t b = 0;
};

/// The triangles' edges with both ends on sides that no triangle has the other way round, in the
/// triangles' order.
std::vector<Edge> open_side_edges(const Mesh& mesh, std::int32_t side256) {
    const auto is_on_side = [&](std::uint32_t vertex) {
        const glm::i32vec3& p = mesh.positions256[vertex];
        return p.x == 0 || p.x == side256 || p.z == 0 || p.z == side256;
    };
    const auto name_of = [](std::uint32_t a, std::uint32_t b) {
        return std::uint64_t{a} << 32U | b;
    };
    std::vector<Edge> edges;
    std::unordered_set<std::uint64_t> known;
    for (std::size_t i = 0; i < mesh.indices.size(); ++i) {
        const std::uint32_t a = mesh.indices[i];
        const std::uint32_t b = mesh.indices[i % 3 == 2 ? i - 2 : i + 1];
        if (is_on_side(a) && is_on_side(b) && mesh.part(a) != MeshPart::water) {
            edges.push_back({.a = a, .b = b});
            known.insert(name_of(a, b));
        }
    }
    std::erase_if(edges, [&](Edge edge) { return known.contains(name_of(edge.b, edge.a)); });
    return edges;
}

}  // namespace

GlbPlace glb_place_of(ColumnPos first, std::int64_t y_voxels, std::int32_t lod,
                      double voxel_size_m) {
    const double column_m = static_cast<double>(std::int64_t{1} << lod) * voxel_size_m;
    return {.corner_m = {static_cast<double>(first.x) * voxel_size_m,
                         static_cast<double>(y_voxels) * voxel_size_m,
                         static_cast<double>(first.z) * voxel_size_m},
            .unit_m = {column_m, voxel_size_m, column_m}};
}

Result<Bytes> encode_glb(const Mesh& mesh, const DracoSettings& settings, const GlbPlace& place) {
    if (!is_inside(mesh, settings)) {
        return fail(ErrorCode::out_of_range,
                    "glb: the mesh leaves its box of " + std::to_string(settings.side) + " x " +
                        std::to_string(settings.height_voxels) + " voxels");
    }
    try {
        std::vector<DracoPart> parts;
        for (const MeshPart which : {MeshPart::ground, MeshPart::cave, MeshPart::water}) {
            const GlbMesh vertices = merged(mesh, settings, which);
            if (vertices.triangles.empty()) {
                continue;
            }
            auto part = draco_part(vertices, settings);
            if (!part) {
                return tl::unexpected(part.error());
            }
            part->part = which;
            parts.push_back(*std::move(part));
        }
        return parts.empty() ? empty_glb() : glb_of_parts(parts, settings, place);
    } catch (const std::exception& error) {
        return fail(ErrorCode::internal, std::string("glb: ") + error.what());
    }
}

Bytes empty_glb() {
    return glb_of(kEmptyJson, {});
}

void add_side_skirts(Mesh& mesh, std::int32_t side) {
    const std::int32_t side256 = side * 256;
    // Seen from outside the solid a triangle lies to the left of its edges, and the tile inside its
    // side: an edge on x = N with the solid below runs towards -z, and so on around.
    const std::array<Side, 4> sides = {{{.axis = 0, .at256 = 0, .along = 2, .direction = 1},
                                        {.axis = 0, .at256 = side256, .along = 2, .direction = -1},
                                        {.axis = 2, .at256 = 0, .along = 0, .direction = -1},
                                        {.axis = 2, .at256 = side256, .along = 0, .direction = 1}}};
    std::unordered_map<std::uint32_t, std::uint32_t> lowered;
    const auto below = [&](std::uint32_t vertex) {
        const auto [place, is_new] =
            lowered.try_emplace(vertex, static_cast<std::uint32_t>(mesh.vertex_count()));
        if (is_new) {
            glm::i32vec3 position = mesh.positions256[vertex];
            position.y = std::max(-256, position.y - kSkirtCells * 256);
            mesh.positions256.push_back(position);
            mesh.normals.push_back(glm::vec3(mesh.normals[vertex]));
            mesh.colors.push_back(glm::u8vec3(mesh.colors[vertex]));
            mesh.material_ids.push_back(std::uint8_t{mesh.material_ids[vertex]});
            if (!mesh.parts.empty()) {
                mesh.parts.push_back(MeshPart{mesh.parts[vertex]});
            }
        }
        return place->second;
    };
    for (const Edge& edge : open_side_edges(mesh, side256)) {
        const bool hangs = std::any_of(sides.begin(), sides.end(), [&](const Side& one) {
            return has_solid_below(one, mesh.positions256[edge.a], mesh.positions256[edge.b]);
        });
        if (hangs) {
            const std::uint32_t a_below = below(edge.a);
            const std::uint32_t b_below = below(edge.b);
            mesh.indices.insert(mesh.indices.end(),
                                {edge.b, edge.a, a_below, edge.b, a_below, b_below});
        }
    }
}

}  // namespace terrane
