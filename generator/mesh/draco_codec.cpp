#include "generator/mesh/draco_codec.h"

#include "generator/mesh/mesh.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <draco/attributes/point_attribute.h>
#include <draco/compression/config/compression_shared.h>
#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/core/decoder_buffer.h>
#include <draco/core/encoder_buffer.h>
#include <draco/mesh/mesh.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <memory>
#include <span>
#include <string>
#include <utility>

namespace terrane {
namespace {

constexpr int kNormalBits = 8;
/// Draco itself takes 1..30 bits.
constexpr int kPositionBitsMax = 30;
constexpr std::uint32_t kTrianglesMax = std::uint32_t{1} << 24;
/// Edgebreaker spends a bit a triangle, less only where it repeats itself endlessly; our flattest
/// meshes have under 8 triangles a byte.
constexpr std::size_t kTrianglesPerByteMax = 128;
/// |coordinate| in voxels; far above any height bound.
constexpr float kCoordinateMax = 1 << 20;

/// An attribute with one value a point, and the values to fill in.
template <typename T>
std::pair<int, T*> add_attribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type,
                                 std::int8_t components, draco::DataType data_type,
                                 bool is_normalized) {
    auto attribute = std::make_unique<draco::PointAttribute>();
    attribute->Init(type, components, data_type, is_normalized, mesh.num_points());
    T* const values = reinterpret_cast<T*>(attribute->buffer()->data());
    return {mesh.AddAttribute(std::move(attribute)), values};
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

/// Fills the Draco mesh and returns the id of its positions.
int fill(draco::Mesh& out, const Mesh& mesh) {
    using Attribute = draco::GeometryAttribute;
    const std::size_t vertices = mesh.vertex_count();
    out.set_num_points(static_cast<std::uint32_t>(vertices));
    const auto [position_id, positions] =
        add_attribute<float>(out, Attribute::POSITION, 3, draco::DT_FLOAT32, false);
    for (std::size_t i = 0; i < vertices; ++i) {
        const glm::i32vec3& p = mesh.positions256[i];
        positions[3 * i] = static_cast<float>(rounded_to_draco_step(p.x)) / 256.0F;
        positions[3 * i + 1] = static_cast<float>(rounded_to_draco_step(p.y)) / 256.0F;
        positions[3 * i + 2] = static_cast<float>(rounded_to_draco_step(p.z)) / 256.0F;
    }
    static_assert(sizeof(glm::vec3) == 12 && sizeof(glm::u8vec3) == 3);
    const auto normals =
        add_attribute<float>(out, Attribute::NORMAL, 3, draco::DT_FLOAT32, false).second;
    std::memcpy(normals, mesh.normals.data(), vertices * sizeof(glm::vec3));
    const auto colors =
        add_attribute<std::uint8_t>(out, Attribute::COLOR, 3, draco::DT_UINT8, true).second;
    std::memcpy(colors, mesh.colors.data(), vertices * sizeof(glm::u8vec3));
    const auto materials =
        add_attribute<std::uint8_t>(out, Attribute::GENERIC, 1, draco::DT_UINT8, false).second;
    std::memcpy(materials, mesh.material_ids.data(), vertices);
    const bool has_parts = std::any_of(mesh.parts.begin(), mesh.parts.end(),
                                       [](MeshPart part) { return part != MeshPart::ground; });
    if (has_parts) {  // after the materials: the second of its type
        const auto parts =
            add_attribute<std::uint8_t>(out, Attribute::GENERIC, 1, draco::DT_UINT8, false).second;
        std::memcpy(parts, mesh.parts.data(), vertices);
    }

    out.SetNumFaces(mesh.triangle_count());
    for (std::uint32_t i = 0; i < mesh.triangle_count(); ++i) {
        const std::uint32_t* const corner = &mesh.indices[std::size_t{3} * i];
        out.SetFace(draco::FaceIndex(i),
                    {draco::PointIndex(corner[0]), draco::PointIndex(corner[1]),
                     draco::PointIndex(corner[2])});
    }
    return position_id;
}

Result<Bytes> encode(const Mesh& mesh, const DracoSettings& settings) {
    draco::Mesh filled;
    const int position_id = fill(filled, mesh);
    draco::ExpertEncoder encoder(filled);
    encoder.SetSpeedOptions(settings.speed, settings.speed);
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
    const int bits = draco_position_bits(settings);
    constexpr std::array<float, 3> kOrigin = {0.0F, -1.0F, 0.0F};
    // (2^b - 1) / 32 is exact, so Draco's own step, range / (2^b - 1), is exactly 1/32.
    const float range = static_cast<float>((1 << bits) - 1) / kDracoStepsPerVoxel;
    encoder.SetAttributeExplicitQuantization(position_id, bits, 3, kOrigin.data(), range);
    encoder.SetAttributeQuantization(filled.GetNamedAttributeId(draco::GeometryAttribute::NORMAL),
                                     kNormalBits);
    draco::EncoderBuffer buffer;
    const draco::Status status = encoder.EncodeToBuffer(&buffer);
    if (!status.ok()) {
        return fail(ErrorCode::internal, "draco cannot encode " +
                                             std::to_string(mesh.triangle_count()) +
                                             " triangles: " + status.error_msg_string());
    }
    const auto encoded = std::as_bytes(std::span(buffer.data(), buffer.size()));
    return Bytes(encoded.begin(), encoded.end());
}

/// Reads what Draco's decoder would allocate for, and refuses what the bytes cannot hold:
/// "DRACO", major u8, minor u8, geometry u8, method u8, flags u16, traversal u8, vertices varint,
/// triangles varint.
Result<void> check_header(std::span<const std::byte> bytes) {
    ByteReader in(bytes);
    const auto magic = in.take(5);
    const auto version = in.fixed<std::uint16_t>();
    const auto geometry = in.fixed<std::uint8_t>();
    const auto method = in.fixed<std::uint8_t>();
    const auto flags = in.fixed<std::uint16_t>();
    const auto traversal = in.fixed<std::uint8_t>();
    const auto vertices = in.varint();
    const auto triangles = in.varint();
    if (!magic || !version || !geometry || !method || !flags || !traversal || !vertices ||
        !triangles || std::memcmp(magic->data(), "DRACO", 5) != 0) {
        return fail(ErrorCode::malformed, "draco: the header is cut short or not Draco's");
    }
    if (*version != (draco::kDracoMeshBitstreamVersionMajor | draco::kDracoMeshBitstreamVersionMinor
                                                                  << 8) ||
        *geometry != draco::TRIANGULAR_MESH || *method != draco::MESH_EDGEBREAKER_ENCODING ||
        *flags != 0) {
        return fail(ErrorCode::malformed, "draco: not an edgebreaker mesh of version 2.2");
    }
    if (*triangles > kTrianglesMax || *triangles > bytes.size() * kTrianglesPerByteMax ||
        *vertices > 3 * *triangles) {
        return fail(ErrorCode::malformed, "draco: " + std::to_string(bytes.size()) +
                                              " bytes cannot hold " + std::to_string(*triangles) +
                                              " triangles of " + std::to_string(*vertices) +
                                              " vertices");
    }
    return {};
}

/// The first attribute of a type, or another, if it is as encode_draco writes it.
const draco::PointAttribute* attribute_of(const draco::Mesh& mesh,
                                          draco::GeometryAttribute::Type type,
                                          draco::DataType data_type, int components,
                                          int which = 0) {
    const draco::PointAttribute* const found =
        mesh.NumNamedAttributes(type) > which ? mesh.GetNamedAttribute(type, which) : nullptr;
    return found != nullptr && found->data_type() == data_type &&
                   found->num_components() == components
               ? found
               : nullptr;
}

/// Copies a point's value; false if it is not there.
template <typename T>
bool read_value(T& out, const draco::PointAttribute& attribute, std::uint32_t point) {
    const draco::AttributeValueIndex index = attribute.mapped_index(draco::PointIndex(point));
    if (index.value() >= attribute.size()) {
        return false;
    }
    std::memcpy(&out, attribute.GetAddress(index), sizeof(T));
    return true;
}

/// False for a coordinate that is no number or beyond reason.
bool to_position256(glm::i32vec3& out, const glm::vec3& voxels) {
    for (int axis = 0; axis < 3; ++axis) {
        if (!(std::abs(voxels[axis]) < kCoordinateMax)) {
            return false;
        }
        out[axis] = static_cast<std::int32_t>(std::floor(voxels[axis] * 256.0F + 0.5F));
    }
    return true;
}

Result<Mesh> converted(const draco::Mesh& in) {
    using Attribute = draco::GeometryAttribute;
    const auto* const positions = attribute_of(in, Attribute::POSITION, draco::DT_FLOAT32, 3);
    const auto* const normals = attribute_of(in, Attribute::NORMAL, draco::DT_FLOAT32, 3);
    const auto* const colors = attribute_of(in, Attribute::COLOR, draco::DT_UINT8, 3);
    const auto* const materials = attribute_of(in, Attribute::GENERIC, draco::DT_UINT8, 1);
    const auto* const parts = attribute_of(in, Attribute::GENERIC, draco::DT_UINT8, 1, 1);
    if (positions == nullptr || normals == nullptr || colors == nullptr || materials == nullptr) {
        return fail(ErrorCode::malformed, "draco: position, normal, colour or material is missing");
    }
    Mesh out;
    const std::uint32_t points = in.num_points();
    out.positions256.resize(points);
    out.normals.resize(points);
    out.colors.resize(points);
    out.material_ids.resize(points);
    out.parts.resize(parts != nullptr ? points : 0);
    for (std::uint32_t i = 0; i < points; ++i) {
        glm::vec3 voxels{};
        if (!read_value(voxels, *positions, i) || !to_position256(out.positions256[i], voxels) ||
            !read_value(out.normals[i], *normals, i) || !read_value(out.colors[i], *colors, i) ||
            !read_value(out.material_ids[i], *materials, i)) {
            return fail(ErrorCode::malformed, "draco: vertex " + std::to_string(i) + " is bad");
        }
        if (parts != nullptr &&
            (!read_value(out.parts[i], *parts, i) || out.parts[i] > MeshPart::water)) {
            return fail(ErrorCode::malformed,
                        "draco: vertex " + std::to_string(i) + " is of no part that is known");
        }
    }
    out.indices.reserve(std::size_t{3} * in.num_faces());
    for (std::uint32_t i = 0; i < in.num_faces(); ++i) {
        for (const draco::PointIndex& corner : in.face(draco::FaceIndex(i))) {
            if (corner.value() >= points) {
                return fail(ErrorCode::malformed, "draco: triangle " + std::to_string(i) +
                                                      " has a vertex beyond the last");
            }
            out.indices.push_back(corner.value());
        }
    }
    return out;
}

}  // namespace

int draco_position_bits(const DracoSettings& settings) {
    const std::int64_t steps =
        std::int64_t{std::max(settings.side + 1, settings.height_voxels)} * kDracoStepsPerVoxel;
    int bits = 1;
    while (bits < kPositionBitsMax && (std::int64_t{1} << bits) - 1 < steps) {
        ++bits;
    }
    return bits;
}

Result<Bytes> encode_draco(const Mesh& mesh, const DracoSettings& settings) {
    if (mesh.indices.empty()) {
        return fail(ErrorCode::invalid_argument, "draco: a mesh without triangles has no encoding");
    }
    if (!is_inside(mesh, settings)) {
        return fail(ErrorCode::out_of_range,
                    "draco: the mesh leaves its box of " + std::to_string(settings.side) + " x " +
                        std::to_string(settings.height_voxels) + " voxels");
    }
    try {
        return encode(mesh, settings);
    } catch (const std::exception& error) {
        return fail(ErrorCode::internal, std::string("draco: ") + error.what());
    }
}

Result<Mesh> decode_draco(std::span<const std::byte> bytes) {
    if (bytes.size() > kDracoBytesMax) {
        return fail(ErrorCode::too_large, "draco: " + std::to_string(bytes.size()) +
                                              " bytes, at most " + std::to_string(kDracoBytesMax));
    }
    if (const auto header = check_header(bytes); !header) {
        return tl::unexpected(header.error());
    }
    try {
        draco::DecoderBuffer buffer;
        buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        draco::Decoder decoder;
        const auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
        if (!decoded.ok()) {
            return fail(ErrorCode::malformed, "draco: " + decoded.status().error_msg_string());
        }
        return converted(*decoded.value());
    } catch (const std::exception& error) {
        return fail(ErrorCode::malformed, std::string("draco: ") + error.what());
    }
}

}  // namespace terrane
