#include "client-sample/cpp/program/obj.h"

#include "generator/mesh/mesh.h"
#include "protocol/base/coords.h"
#include "protocol/wire/messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>

namespace terrane {

namespace {

/// IEC 61966-2-1, linear 0..255 to sRGB 0..1.
double srgb_of(std::uint8_t linear) {
    const double value = linear / 255.0;
    return value <= 0.0031308 ? 12.92 * value : 1.055 * std::pow(value, 1 / 2.4) - 0.055;
}

template <typename... Values>
void append_line(std::string& text, const char* format, Values... values) {
    std::array<char, 256> line{};
    // The length that the line wants, which may be more than fits: nothing here is near 256
    // characters while voxels are at most 1000 m, and a cut line is better than foreign memory.
    const int wanted = std::snprintf(line.data(), line.size(), format, values...);
    text.append(line.data(),
                std::min(static_cast<std::size_t>(std::max(wanted, 0)), line.size() - 1));
}

}  // namespace

std::string obj_of(const Mesh& mesh, ChunkPos key, const ServerHello& world) {
    const double voxel_m = world.voxel_size_m;
    const double column_m = voxel_m * static_cast<double>(std::int64_t{1} << key.lod);
    const double side_m = world.chunk_side * column_m;
    std::string text;
    append_line(text, "# Terrane chunk %d/%d/%d/%d, metres, y up\no chunk_%d_%d_%d_%d\n", key.lod,
                key.x, key.y, key.z, key.lod, key.x, key.y, key.z);
    for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
        const auto& p = mesh.positions256[i];
        append_line(text, "v %.6f %.6f %.6f", key.x * side_m + p.x / 256.0 * column_m,
                    (static_cast<double>(key.y) * world.chunk_height + p.y / 256.0) * voxel_m,
                    key.z * side_m + p.z / 256.0 * column_m);
        if (i < mesh.colors.size()) {
            const auto& c = mesh.colors[i];
            append_line(text, " %.4f %.4f %.4f", srgb_of(c.r), srgb_of(c.g), srgb_of(c.b));
        }
        text += '\n';
    }
    // A level's tile is wider than it is high by 2^lod; its normals are given before that stretch.
    const double stretch = column_m / voxel_m;
    for (const auto& n : mesh.normals) {
        const double x = static_cast<double>(n.x) / stretch;
        const double z = static_cast<double>(n.z) / stretch;
        const double length = std::sqrt(x * x + static_cast<double>(n.y * n.y) + z * z);
        if (length > 0) {
            append_line(text, "vn %.4f %.4f %.4f\n", x / length, static_cast<double>(n.y) / length,
                        z / length);
        } else {  // of no direction: up does no harm
            text += "vn 0.0000 1.0000 0.0000\n";
        }
    }
    const bool has_normals = mesh.normals.size() == mesh.vertex_count();
    for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
        const unsigned a = mesh.indices[i] + 1;
        const unsigned b = mesh.indices[i + 1] + 1;
        const unsigned c = mesh.indices[i + 2] + 1;
        if (has_normals) {
            append_line(text, "f %u//%u %u//%u %u//%u\n", a, a, b, b, c, c);
        } else {
            append_line(text, "f %u %u %u\n", a, b, c);
        }
    }
    return text;
}

}  // namespace terrane
