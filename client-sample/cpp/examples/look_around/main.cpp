// Looks around from a place and says what is there. CMakeLists.txt beside it builds it anywhere.
#include <terrane/terrane.h>

#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
    const auto port = static_cast<std::uint16_t>(argc > 1 ? std::atoi(argv[1]) : 7777);
    auto terrain = terrane::Terrain::connect(
        {.client = {.host = "127.0.0.1", .port = port}, .radius_chunks = {1, 2, 2}});
    if (!terrain || !terrain->look({.x = 10, .y = 150, .z = 20})) {
        std::fprintf(stderr, "no terrain: %s\n", terrain ? "" : terrain.error().message.c_str());
        return 1;
    }
    std::size_t triangles = 0;
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!terrain->is_filled() && std::chrono::steady_clock::now() < until) {
        const auto frame = std::chrono::steady_clock::now() + std::chrono::milliseconds(16);
        const auto changes = terrain->poll(frame);
        if (!changes) {
            std::fprintf(stderr, "%s\n", changes.error().message.c_str());
            return 1;
        }
        for (const terrane::TerrainChange& change : *changes) {
            if (const auto* ready = std::get_if<terrane::ChunkReady>(&change)) {
                triangles += ready->mesh.triangle_count();  // a game would draw it
            }
        }
    }
    const auto ground = terrain->columns().ground_under({.x = 10, .z = 20}, 10'000);
    const auto y = static_cast<std::int64_t>(ground.value_or(0)) - 1;
    const auto voxel = terrain->columns().voxel({.x = 10, .y = y, .z = 20});
    std::printf("%s: %zu triangles; at (10, 20) ground at %.2f, of %s\n",
                terrain->world().world_name.c_str(), triangles, ground.value_or(-1),
                voxel ? terrain->world().materials[voxel->shares()[0].material].name.c_str() : "?");
    return terrain->is_filled() && ground && voxel ? 0 : 1;
}
