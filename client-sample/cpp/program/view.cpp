#include "client-sample/cpp/program/view.h"

#include "client-sample/cpp/connection.h"
#include "client-sample/cpp/program/door_flags.h"
#include "client-sample/cpp/program/get.h"
#include "client-sample/cpp/program/program.h"
#include "client-sample/cpp/program/raster.h"
#include "client-sample/cpp/terrain.h"
#include "generator/mesh/mesh.h"
#include "generator/world/composition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "protocol/base/write_file.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <numbers>
#include <string>
#include <variant>
#include <vector>

namespace terrane {

namespace {

constexpr std::uint32_t kViewRadiusMax = 64;

/// A mesh's vertices as seen from the eye. A level's columns are 2^lod voxels apart, and its
/// normals are given before that stretch.
std::vector<RasterVertex> vertices_of(const ChunkReady& ready, const Terrain& terrain,
                                      const glm::dvec3& eye) {
    const Terrain::Placement place = terrain.placement_of(ready.key);
    const double voxel_m = terrain.world().voxel_size_m;
    const glm::dvec3 corner = glm::dvec3(place.x_m, place.y_m, place.z_m) / voxel_m - eye;
    const glm::dvec3 scale = glm::dvec3(place.across_m, place.upwards_m, place.across_m) / voxel_m;
    const auto stretch = static_cast<float>(scale.x / scale.y);
    const Mesh& mesh = ready.mesh;
    std::vector<RasterVertex> vertices;
    vertices.reserve(mesh.vertex_count());
    for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
        glm::vec3 normal(0, 1, 0);
        if (i < mesh.normals.size()) {
            const glm::vec3 wide(mesh.normals[i].x / stretch, mesh.normals[i].y,
                                 mesh.normals[i].z / stretch);
            normal = glm::length(wide) > 0 ? glm::normalize(wide) : normal;
        }
        LinearColor color{.r = 0.5F, .g = 0.5F, .b = 0.5F};
        if (i < mesh.colors.size()) {
            color = {.r = static_cast<float>(mesh.colors[i].r) / 255,
                     .g = static_cast<float>(mesh.colors[i].g) / 255,
                     .b = static_cast<float>(mesh.colors[i].b) / 255};
        }
        vertices.push_back(
            {.from_eye = glm::vec3(corner + glm::dvec3(mesh.positions256[i]) * scale),
             .normal = normal,
             .color = color});
    }
    return vertices;
}

double horizon_of(const TerrainOptions& options, const ServerHello& world) {
    const std::size_t levels =
        std::min<std::size_t>(options.radius_chunks.size(), static_cast<std::size_t>(world.levels));
    const double radius = std::min(options.radius_chunks[levels - 1], world.limits.view_radius_max);
    return std::max(radius, 0.5) * world.chunk_side * std::exp2(levels - 1);
}

}  // namespace

Result<DrawnView> draw_view(const TerrainOptions& options, Camera camera, Deadline deadline) {
    auto terrain = Terrain::connect(options);
    if (!terrain) {
        return tl::unexpected(terrain.error());
    }
    camera.horizon_voxels = horizon_of(options, terrain->world());
    Raster raster(camera);
    const glm::vec3 ahead(glm::normalize(camera.look - camera.eye));
    const auto looked = terrain->look({.x = camera.eye.x,
                                       .y = camera.eye.y,
                                       .z = camera.eye.z,
                                       .direction = {.x = ahead.x, .y = ahead.y, .z = ahead.z},
                                       .velocity = {},
                                       .field_of_view = static_cast<float>(camera.field_of_view)});
    if (!looked) {
        return tl::unexpected(looked.error());
    }
    DrawnView drawn;
    for (;;) {
        const auto now = std::chrono::steady_clock::now();
        const bool was_filled = terrain->is_filled();
        const auto changes = terrain->poll(was_filled ? now : deadline);
        if (!changes) {
            return tl::unexpected(changes.error());
        }
        for (const TerrainChange& change : *changes) {
            if (const auto* ready = std::get_if<ChunkReady>(&change)) {
                ++drawn.chunks;
                drawn.triangles += ready->mesh.triangle_count();
                raster.draw(vertices_of(*ready, *terrain, camera.eye), ready->mesh.indices);
            } else if (const auto* failure = std::get_if<Failure>(&change);
                       failure != nullptr && failure->error.code != ErrorCode::busy) {
                return tl::unexpected(failure->error);
            }
        }
        if (was_filled && changes->empty() && !terrain->has_work()) {
            break;
        }
        if (!terrain->is_filled() && std::chrono::steady_clock::now() >= deadline) {
            return fail(ErrorCode::io_error, std::to_string(terrain->missing()) +
                                                 " chunks of the view did not come in time");
        }
    }
    drawn.bytes = terrain->received_bytes();
    drawn.covered = raster.covered();
    drawn.picture = raster.picture();
    return drawn;
}

namespace {

/// As CLI11 gives them, before they are understood.
struct ViewFlags {
    std::string server = "127.0.0.1:7777";
    std::array<double, 3> eye{};
    std::array<double, 3> look{};
    std::array<std::int32_t, 2> size = {1280, 720};
    double field_of_view_degrees = 55;
    std::string form = "draco";
    std::vector<std::uint32_t> radius_chunks = {8, 8, 8, 8, 8, 8};
    std::string token;
    TlsUse tls;
    std::string out;
    double timeout_seconds = 120;
};

int complain(const std::string& text, int code) {
    std::fprintf(stderr, "terrane-client: view: %s\n", text.c_str());
    return code;
}

int run_view(const ViewFlags& flags) {
    const auto address = parse_address(flags.server);
    if (!address) {
        return complain("--server: " + address.error().message, kClientWrongUse);
    }
    if (flags.eye == flags.look) {
        return complain("--eye and --look are one place: there is no direction", kClientWrongUse);
    }
    const auto timeout =
        std::chrono::milliseconds(static_cast<std::int64_t>(flags.timeout_seconds * 1000));
    TerrainOptions options;
    options.client = {.host = address->host,
                      .port = address->port,
                      .timeout = timeout,
                      .client_name = "terrane-client view",
                      .token = flags.token,
                      .tls = flags.tls};
    options.form = flags.form == "columns"  ? TerrainForm::columns
                   : flags.form == "blocky" ? TerrainForm::blocky
                                            : TerrainForm::draco;
    options.radius_chunks = flags.radius_chunks;
    if (options.form == TerrainForm::blocky) {
        options.radius_chunks.resize(1);  // there are blocks at level 0 only
    }
    const Camera camera{.eye = {flags.eye[0], flags.eye[1], flags.eye[2]},
                        .look = {flags.look[0], flags.look[1], flags.look[2]},
                        .width = flags.size[0],
                        .height = flags.size[1],
                        .field_of_view = flags.field_of_view_degrees * std::numbers::pi / 180,
                        .horizon_voxels = 1};
    const auto drawn = draw_view(options, camera, std::chrono::steady_clock::now() + timeout);
    if (!drawn) {
        return complain(drawn.error().message, kClientFailed);
    }
    const auto written = png_of(drawn->picture).and_then([&](const Bytes& bytes) {
        return write_file(flags.out, bytes);
    });
    if (!written) {
        return complain(written.error().message, kClientFailed);
    }
    std::fprintf(stderr,
                 "%s: %d x %d pixels, %zu chunks, %zu triangles, %.1f MB, %.0f %% terrain\n",
                 flags.out.c_str(), drawn->picture.width, drawn->picture.height, drawn->chunks,
                 drawn->triangles, static_cast<double>(drawn->bytes) / 1e6, 100 * drawn->covered);
    return kClientDone;
}

}  // namespace

void add_view_command(CLI::App& app, int& exit_code) {
    const auto flags = std::make_shared<ViewFlags>();
    CLI::App* view = app.add_subcommand("view", "Draw what the server sends, as seen from a place");
    const auto numbers = CLI::Range(-9e15, 9e15);
    view->add_option("--server", flags->server, "Where the server listens")
        ->type_name("HOST:PORT")
        ->capture_default_str();
    view->add_option("--eye", flags->eye, "Where to stand, voxels; y is up")
        ->delimiter(',')
        ->required()
        ->check(numbers)
        ->type_name("X,Y,Z");
    view->add_option("--look", flags->look, "What to look at, voxels")
        ->delimiter(',')
        ->required()
        ->check(numbers)
        ->type_name("X,Y,Z");
    view->add_option("-o,--output", flags->out, "PNG file to write")->required()->type_name("FILE");
    view->add_option("--size", flags->size, "Pixels; 1280,720 if absent")
        ->delimiter(',')
        ->check(CLI::Range(1, kPictureSideMax))
        ->type_name("W,H");
    view->add_option("--fov", flags->field_of_view_degrees, "Degrees along the longer side")
        ->check(CLI::Range(1.0, 150.0))
        ->capture_default_str();
    view->add_option("--radius", flags->radius_chunks,
                     "How far: a radius for each level from 0 up, in its chunk sides")
        ->delimiter(',')
        ->expected(1, static_cast<int>(kViewLevelsMax))
        ->check(CLI::Range(std::uint32_t{1}, kViewRadiusMax))
        ->type_name("R0,R1,..")
        ->capture_default_str();
    view->add_option("--form", flags->form,
                     "draco: the server's meshes; columns: meshes made here from columns; blocky: "
                     "blocks, level 0 only")
        ->check(CLI::IsMember({"draco", "columns", "blocky"}))
        ->capture_default_str();
    add_door_flags(*view, flags->token, flags->tls);
    view->add_option("--timeout", flags->timeout_seconds, "Give up after this long, seconds")
        ->check(CLI::Range(0.1, 86400.0))
        ->capture_default_str();
    view->footer(
        "Exit code: 0 drawn, 1 chunks did not come or the file cannot be written, 2 wrong use.\n"
        "Example: terrane-client view --eye 0,260,0 --look 400,150,300 -o view.png");
    view->callback([flags, &exit_code] { exit_code = run_view(*flags); });
}

}  // namespace terrane
