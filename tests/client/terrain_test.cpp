// Terrain against a real server in this process, and against peers that play what servers seldom
// do.
#include "client-sample/cpp/terrain.h"

#include "client-sample/cpp/program/load.h"
#include "client-sample/cpp/program/view.h"
#include "generator/mesh/draco_codec.h"
#include "server/server.h"
#include "tests/client/scripted_peer.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <set>
#include <tuple>
#include <vector>

namespace terrane {
namespace {

using std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto kPatience = 60s;  // sanitizers on a busy machine

/// What a game would show: the last mesh of every chunk.
struct Shown {
    std::map<ChunkPos, Mesh> meshes;
    std::size_t gone = 0;
    std::vector<Failure> failures;

    void take(std::vector<TerrainChange> changes) {
        for (TerrainChange& change : changes) {
            if (auto* ready = std::get_if<ChunkReady>(&change)) {
                meshes.insert_or_assign(ready->key, std::move(ready->mesh));
            } else if (const auto* left = std::get_if<ChunkGone>(&change)) {
                meshes.erase(left->key);
                ++gone;
            } else {
                failures.push_back(std::get<Failure>(change));
            }
        }
    }
};

/// Polls until the view is filled and everything has been meshed.
void fill(Terrain& terrain, Shown& shown) {
    const Deadline deadline = steady_clock::now() + kPatience;
    for (;;) {
        const bool was_filled = terrain.is_filled();
        auto changes = terrain.poll(was_filled ? steady_clock::now() : deadline);
        ASSERT_TRUE(changes) << changes.error().message;
        if (was_filled && changes->empty() && !terrain.has_work()) {
            return;
        }
        shown.take(std::move(*changes));
        ASSERT_LT(steady_clock::now(), deadline) << terrain.missing() << " chunks are missing";
    }
}

using Corners = std::vector<std::array<std::tuple<int, int, int>, 3>>;

/// Triangles by place alone, as Draco would round them.
Corners corners_of(const Mesh& mesh) {
    Corners corners;
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
        auto& triangle = corners.emplace_back();
        for (std::size_t k = 0; k < 3; ++k) {
            const auto& p = mesh.positions256[mesh.indices[i + k]];
            triangle[k] = {rounded_to_draco_step(p.x), rounded_to_draco_step(p.y),
                           rounded_to_draco_step(p.z)};
        }
        // The least of its turns: rounding makes corners equal.
        const auto first = triangle;
        for (std::size_t turn = 1; turn < 3; ++turn) {
            triangle =
                std::min(triangle, {first[turn], first[(turn + 1) % 3], first[(turn + 2) % 3]});
        }
    }
    std::ranges::sort(corners);
    return corners;
}

class TerrainTest : public testing::Test {
  protected:
    void SetUp() override { start("basin"); }

    void start(const std::string& name) {
        auto world = load_shipped_world(name);
        ASSERT_NE(world, nullptr);
        ServerOptions options;
        options.world = world;
        options.listen.endpoint = {.address = "127.0.0.1", .port = 0};
        options.workers = 2;
        options.http = Endpoint{.address = "127.0.0.1", .port = 0};
        options.store = StoreKind::memory;
        auto server = Server::start(options, log_);
        ASSERT_TRUE(server) << server.error().message;
        server_ = std::move(*server);
    }

    Result<Terrain> connect(TerrainForm form, std::vector<std::uint32_t> radius_chunks) const {
        return Terrain::connect({.client = {.host = "127.0.0.1",
                                            .port = server_->endpoint().port,
                                            .timeout = 30s,
                                            .client_name = "terrain_test",
                                            .token = {}},
                                 .form = form,
                                 .radius_chunks = std::move(radius_chunks)});
    }

    void expect_columns_are_the_servers(const Viewer& viewer);

    Log log_{LogFormat::text, LogLevel::off};
    std::unique_ptr<Server> server_;
};

/// Triangles of ground, caves and water.
std::array<std::size_t, 3> count_parts(const Mesh& mesh) {
    std::array<std::size_t, 3> counts{};
    for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
        ++counts.at(static_cast<std::size_t>(mesh.part_of_triangle(i)));
    }
    return counts;
}

void TerrainTest::expect_columns_are_the_servers(const Viewer& viewer) {
    auto from_columns = connect(TerrainForm::columns, {1, 2});
    auto from_draco = connect(TerrainForm::draco, {1, 2});
    ASSERT_TRUE(from_columns && from_draco);
    Shown columns;
    Shown draco;
    ASSERT_TRUE(from_columns->look(viewer) && from_draco->look(viewer));
    ASSERT_NO_FATAL_FAILURE(fill(*from_columns, columns));
    ASSERT_NO_FATAL_FAILURE(fill(*from_draco, draco));
    ASSERT_EQ(columns.meshes.size(), draco.meshes.size());
    std::size_t exact = 0;
    std::size_t triangles = 0;
    for (const auto& [key, mesh] : columns.meshes) {
        ASSERT_TRUE(draco.meshes.contains(key));
        if (from_columns->columns().missing_for_mesh(key).empty()) {
            EXPECT_EQ(corners_of(mesh), corners_of(draco.meshes.at(key)));
            EXPECT_EQ(count_parts(mesh), count_parts(draco.meshes.at(key)));
            ++exact;
            triangles += mesh.triangle_count();
        }
    }
    EXPECT_GT(exact, 5U);
    EXPECT_GT(triangles, 1000U);
    EXPECT_GT(from_columns->received_bytes(), 0U);
    EXPECT_TRUE(columns.failures.empty() && draco.failures.empty());
}

TEST_F(TerrainTest, MeshesOfColumnsAreTheServers) {
    expect_columns_are_the_servers({.x = 40, .y = 150, .z = -70, .direction = {}, .velocity = {}});
}

TEST_F(TerrainTest, MeshesOfALandscapesColumnsAreTheServersPartsIncluded) {
    start("canyon");
    expect_columns_are_the_servers({.x = 40, .y = 90, .z = -70, .direction = {}, .velocity = {}});
}

TEST_F(TerrainTest, WalkingOnShowsWhatALookThereShows) {
    auto walked = connect(TerrainForm::columns, {1, 1});
    auto there = connect(TerrainForm::columns, {1, 1});
    ASSERT_TRUE(walked && there);
    Shown on_the_way;
    for (const double x : {16.0, 48.0, 90.0, 130.0}) {
        ASSERT_TRUE(walked->look({.x = x, .y = 150, .z = 16, .direction = {}, .velocity = {}}));
        ASSERT_NO_FATAL_FAILURE(fill(*walked, on_the_way));
    }
    // What has left the view is told behind what has come; one more round trip and it is here.
    ASSERT_TRUE(walked->look({.x = 130, .y = 150, .z = 16, .direction = {}, .velocity = {}}));
    Shown at_once;
    ASSERT_TRUE(there->look({.x = 130, .y = 150, .z = 16, .direction = {}, .velocity = {}}));
    ASSERT_NO_FATAL_FAILURE(fill(*there, at_once));
    EXPECT_GT(on_the_way.gone, 0U);
    for (const auto& [key, mesh] : at_once.meshes) {
        ASSERT_TRUE(on_the_way.meshes.contains(key));
        if (there->columns().missing_for_mesh(key).empty()) {
            EXPECT_EQ(corners_of(on_the_way.meshes.at(key)), corners_of(mesh));
        }
    }
    const auto ground = walked->columns().ground_under({.x = 130, .z = 16}, 1e6);
    ASSERT_TRUE(ground);
    EXPECT_EQ(walked->columns().is_solid(
                  {.x = 130, .y = static_cast<std::int64_t>(*ground) - 1, .z = 16}),
              true);
}

TEST_F(TerrainTest, DrawsAPicture) {
    const TerrainOptions options{.client = {.host = "127.0.0.1",
                                            .port = server_->endpoint().port,
                                            .timeout = 30s,
                                            .client_name = "terrain_test",
                                            .token = {}},
                                 .form = TerrainForm::draco,
                                 .radius_chunks = {2, 2, 2}};
    Camera camera{.eye = {0, 260, 0}, .look = {100, 200, 80}, .width = 160, .height = 90};
    const auto drawn = draw_view(options, camera, steady_clock::now() + kPatience);
    ASSERT_TRUE(drawn) << drawn.error().message;
    EXPECT_GT(drawn->triangles, 1000U);
    EXPECT_GT(drawn->covered, 0.3);
    EXPECT_LT(drawn->covered, 1.0) << "there is a sky";
    std::set<std::tuple<int, int, int>> colors;
    for (const Rgb8 pixel : drawn->picture.pixels) {
        colors.insert({pixel.r, pixel.g, pixel.b});
    }
    EXPECT_GT(colors.size(), 50U);
    EXPECT_TRUE(png_of(drawn->picture));
}

TEST_F(TerrainTest, ALoadOfAllWaysToTravelIsRightAndEnds) {
    for (const CarrierKind carrier :
         {CarrierKind::tcp, CarrierKind::web_socket, CarrierKind::http}) {
        LoadOptions options;
        options.host = "127.0.0.1";
        options.port = carrier == CarrierKind::tcp ? server_->endpoint().port
                                                   : server_->http_endpoint().value().port;
        options.carrier = carrier;
        options.clients = 4;
        options.seconds = 1.5;
        options.ramp_seconds = 0.2;
        options.movements = {MovementKind::walk, MovementKind::fly};
        options.spread_voxels = 64;
        options.check_every = 5;
        options.client.radius_chunks = {1, 1};
        options.client.by_view = carrier != CarrierKind::http;
        options.client.patience = 30s;
        const auto result = run_load(options, [](const std::string&) {});
        ASSERT_TRUE(result) << result.error().message;
        EXPECT_TRUE(result->is_good()) << load_text(*result);
        EXPECT_GT(result->chunks, 100U);
        EXPECT_GT(result->checked, 10U) << load_text(*result);
        EXPECT_EQ(result->wrong, 0U) << load_text(*result);
        EXPECT_EQ(result->fill.count(), 4U) << load_text(*result);
        EXPECT_GT(result->fairness, 0.2);
    }
}

// --- scripted peers ---

ServerHello hello_with_views() {
    ServerHello hello = test_hello();
    hello.limits.view_radius_max = 8;
    hello.limits.credit_window_bytes = 1U << 18U;
    return hello;
}

ChunkAnswer empty_chunk(ChunkPos key) {
    ChunkAnswer answer;
    answer.key = key;
    answer.status = ChunkStatus::empty;
    return answer;
}

TEST(TerrainWithAPeer, TellsWhatCameWhatLeftAndWhatWasRefused) {
    const ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet(hello_with_views());
        ASSERT_TRUE(socket.receive_kind<ViewUpdate>());
        for (std::int32_t y = 0; y < 3; ++y) {
            socket.send(empty_chunk({.lod = 0, .x = 0, .y = y, .z = 0}));
        }
        socket.send(Failure{.request_id = 0,
                            .error = {.code = ErrorCode::internal, .message = "broken"},
                            .retry_after_ms = 0,
                            .key = ChunkPos{.lod = 0, .x = 0, .y = 3, .z = 0}});
        ASSERT_TRUE(socket.receive_kind<ViewUpdate>());
        socket.send(ChunkForget{.keys = {{.lod = 0, .x = 0, .y = 1, .z = 0}}});
        socket.send(Goodbye{.code = ErrorCode::draining, .reason = "the end"});
        socket.wait_for_end();
    });
    auto terrain = Terrain::connect(
        {.client = {.port = peer.port()}, .form = TerrainForm::draco, .radius_chunks = {0}});
    ASSERT_TRUE(terrain) << terrain.error().message;
    EXPECT_FALSE(terrain->is_filled());
    ASSERT_TRUE(terrain->look({.x = 16, .y = 16, .z = 16, .direction = {}, .velocity = {}}));
    EXPECT_EQ(terrain->missing(), 4U);
    Shown shown;
    ASSERT_NO_FATAL_FAILURE(fill(*terrain, shown));
    EXPECT_EQ(shown.meshes.size(), 3U);
    ASSERT_EQ(shown.failures.size(), 1U);
    EXPECT_EQ(shown.failures[0].error.message, "broken");
    ASSERT_TRUE(terrain->look({.x = 80, .y = 16, .z = 16, .direction = {}, .velocity = {}}));
    EXPECT_EQ(terrain->missing(), 4U);
    const Deadline deadline = steady_clock::now() + kPatience;
    std::string ending;
    while (ending.empty()) {
        auto changes = terrain->poll(deadline);
        if (changes) {
            shown.take(std::move(*changes));
        } else {
            ending = changes.error().message;
        }
    }
    EXPECT_NE(ending.find("the end"), std::string::npos) << ending;
}

TEST(TerrainWithAPeer, RefusesAServerWithoutViews) {
    const ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        socket.wait_for_end();
    });
    const auto terrain = Terrain::connect({.client = {.port = peer.port()}});
    ASSERT_FALSE(terrain);
    EXPECT_EQ(terrain.error().code, ErrorCode::unsupported);
}

}  // namespace
}  // namespace terrane
