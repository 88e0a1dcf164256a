// The small parts of the load tester: ways to move, percentiles, fairness, WebSocket frames, and
// the comparison with local generation.
#include "client-sample/cpp/program/latency_counts.h"
#include "client-sample/cpp/program/load_report.h"
#include "client-sample/cpp/program/local_check.h"
#include "client-sample/cpp/program/movement.h"
#include "client-sample/cpp/program/websocket_stream.h"
#include "generator/mesh/draco_codec.h"
#include "generator/mesh/surface_nets.h"
#include "generator/terrain/generate_stack.h"
#include "generator/volume/chunk_codec.h"
#include "generator/world/world_file.h"
#include "protocol/wire/column_payload.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>

namespace terrane {
namespace {

using namespace std::chrono_literals;

TEST(MovementTest, IsAFunctionOfSeedAndTime) {
    for (const MovementKind kind :
         {MovementKind::walk, MovementKind::fly, MovementKind::teleport}) {
        MovementStart start{.kind = kind,
                            .seed = 3,
                            .x = 100,
                            .y = 0,
                            .z = -50,
                            .spread_voxels = 10,
                            .path = nullptr,
                            .path_offset_seconds = 0};
        Movement fine(start);
        Movement coarse(start);
        for (int i = 1; i < 400; ++i) {
            fine.at(i * 0.1);
        }
        const ViewerPlace a = fine.at(40);
        const ViewerPlace b = coarse.at(40);
        EXPECT_NEAR(a.x, b.x, 1e-6);
        EXPECT_NEAR(a.z, b.z, 1e-6);
        start.seed = 4;
        EXPECT_NE(Movement(start).at(40).x, b.x);
    }
}

TEST(MovementTest, WalksNoFasterThanWalkers) {
    Movement walker({.kind = MovementKind::walk,
                     .seed = 1,
                     .x = 0,
                     .y = 0,
                     .z = 0,
                     .spread_voxels = 0,
                     .path = nullptr,
                     .path_offset_seconds = 0});
    ViewerPlace last = walker.at(0);
    for (int i = 1; i < 100; ++i) {
        const ViewerPlace place = walker.at(i * 0.5);
        EXPECT_LE(std::hypot(place.x - last.x, place.z - last.z),
                  kWalkVoxelsPerSecond * 0.5 + 1e-9);
        last = place;
    }
}

TEST(MovementTest, FollowsAPathAndBeginsAgain) {
    const auto path = parse_path("# a tour\n0 0 10 0\n10, 100, 20, 0\n\n20 100 20 50 # end\n");
    ASSERT_TRUE(path) << path.error().message;
    Movement tour({.kind = MovementKind::path,
                   .seed = 0,
                   .x = 0,
                   .y = 0,
                   .z = 0,
                   .spread_voxels = 0,
                   .path = std::make_shared<const std::vector<PathPoint>>(*path),
                   .path_offset_seconds = 5});
    EXPECT_EQ(tour.at(0).x, 50);
    EXPECT_EQ(tour.at(0).y, 15);
    EXPECT_EQ(tour.at(0).velocity_x, 10);
    EXPECT_EQ(tour.at(10).z, 25);
    EXPECT_EQ(tour.at(16).x, 10) << "5 + 16 is 1 s into the second round";
}

TEST(MovementTest, RefusesPathsThatAreNone) {
    for (const char* text : {"", "# nothing\n", "0 1 2\n", "0 1 2 3 4\n", "1 0 0 0\n1 0 0 0\n",
                             "-1 0 0 0\n", "0 nan 0 0\n", "0 1e300 0 0\n", "a b c d\n"}) {
        EXPECT_FALSE(parse_path(text)) << text;
    }
    EXPECT_NE(parse_path("0 0 0 0\nx\n").error().message.find("line 2"), std::string::npos);
}

TEST(LatencyCountsTest, QuantilesAreWithinThreePercent) {
    LatencyCounts counts;
    EXPECT_EQ(counts.quantile_ms(0.5), 0);
    for (int i = 1; i <= 1000; ++i) {
        counts.add(std::chrono::microseconds(i * 100));
    }
    EXPECT_NEAR(counts.quantile_ms(0.5), 50, 1.5);
    EXPECT_NEAR(counts.quantile_ms(0.9), 90, 2.7);
    EXPECT_NEAR(counts.quantile_ms(0.99), 99, 3);
    EXPECT_EQ(counts.quantile_ms(1), 100);
    EXPECT_EQ(counts.max_ms(), 100);
    LatencyCounts other;
    other.add(24h);
    other.add(counts);
    EXPECT_EQ(other.count(), 1001U);
    EXPECT_EQ(other.max_ms(), 86'400'000);
}

TEST(LoadReportTest, FairnessIsJains) {
    EXPECT_EQ(jain_index({}), 1);
    EXPECT_DOUBLE_EQ(jain_index(std::vector{3.0, 3.0, 3.0}), 1);
    EXPECT_DOUBLE_EQ(jain_index(std::vector{1.0, 0.0, 0.0, 0.0}), 0.25);
}

TEST(LoadReportTest, RatesAreOfThoseThatCompete) {
    LoadCounts counts;
    counts.chunks = 300;
    counts.wanting = 10s;
    EXPECT_EQ(rate_of(counts, {.chunks = 100, .wanting = 5s}), 40);
    EXPECT_EQ(rate_of(counts, {.chunks = 300, .wanting = 5s}), 0) << "starved";
    counts.fill = 6s;
    counts.fill_chunks = 200;
    EXPECT_EQ(rate_of(counts, {.chunks = 100, .wanting = 5s}), 100);
    EXPECT_FALSE(rate_of(counts, {.chunks = 250, .wanting = 8s})) << "whole before";
}

TEST(LoadReportTest, JsonHasWhatScriptsRead) {
    LoadResult result;
    LoadCounts counts;
    counts.chunks = 10;
    counts.bytes = 1000;
    counts.wasted_bytes = 100;
    counts.undecodable = 2;
    counts.latency.add(5ms);
    add(result, counts);
    result.clients = 1;
    result.seconds = 2;
    const auto json = nlohmann::json::parse(load_json(result));
    for (const char* key :
         {"clients", "seconds", "chunks", "chunks_per_s", "bytes", "checked", "wrong", "hung",
          "busy", "p50_ms", "p90_ms", "p99_ms", "max_ms", "fairness", "wasted_share"}) {
        EXPECT_TRUE(json.contains(key)) << key;
    }
    EXPECT_EQ(json["chunks_per_s"], 5);
    EXPECT_EQ(json["wasted_share"], 0.1);
    EXPECT_EQ(json["wrong"], 2);
    EXPECT_EQ(json["max_ms"], 5);
    EXPECT_FALSE(result.is_good());
    EXPECT_NE(load_text(result).find("wrong 2"), std::string::npos);
}

// --- WebSocket ---

Bytes bytes_from(std::string_view text) {
    const auto bytes = bytes_of(text);
    return {bytes.begin(), bytes.end()};
}

/// An upgraded stream: the answer is made from the key in its own opening.
WebSocketStream upgraded() {
    WebSocketStream stream({.host = "h:1", .path = "/ws", .seed = 9});
    return stream;
}

TEST(WebSocketStreamTest, AsksForTheUpgradeAndRefusesOtherAnswers) {
    WebSocketStream stream = upgraded();
    const Bytes opening = stream.opening();
    const std::string_view text = text_of(opening);
    EXPECT_TRUE(text.starts_with("GET /ws HTTP/1.1\r\nHost: h:1\r\n"));
    Bytes out;
    WebSocketStream other = upgraded();
    const auto refused = other.feed(out, bytes_from("HTTP/1.1 404 Not Found\r\n\r\n"));
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("404"), std::string::npos);
    const auto wrong = stream.feed(
        out, bytes_from("HTTP/1.1 101 Switching Protocols\r\nSec-WebSocket-Accept: no\r\n\r\n"));
    ASSERT_FALSE(wrong);
    EXPECT_EQ(wrong.error().code, ErrorCode::malformed);
    WebSocketStream endless = upgraded();
    EXPECT_FALSE(endless.feed(out, Bytes(kUpgradeAnswerBytesMax + 1, std::byte{'a'})));
}

// --- Local generation ---

class ChunkCheckerTest : public testing::Test {
  protected:
    void SetUp() override {
        world_ = load_shipped_world("basin");
        ASSERT_NE(world_, nullptr);
        StackGenerator generator(*world_);
        ASSERT_TRUE(generator.generate(stack_, {.lod = 0, .x = 1, .z = -1}));
        const std::int32_t height = world_->definition.grid.height;
        y_ = stack_.highest_y256 / 256 / height;
        key_ = {.lod = 0, .x = 1, .y = y_, .z = -1};
    }

    ChunkAnswer answer(ChunkFormat format, ChunkStatus status) const {
        ChunkAnswer answer;
        answer.key = key_;
        answer.format = format;
        answer.status = status;
        return answer;
    }

    std::shared_ptr<const World> world_;
    Stack stack_;
    std::int32_t y_ = 0;
    ChunkPos key_;
};

TEST_F(ChunkCheckerTest, FindsOneWrongByteOfColumns) {
    Chunk chunk;
    cut_chunk(chunk, stack_, y_, world_->definition.grid.height);
    ASSERT_FALSE(chunk.uniform);
    Bytes bytes;
    encode_chunk(bytes, chunk);
    ChunkChecker checker(world_);
    const auto full = answer(ChunkFormat::columns, ChunkStatus::full);
    EXPECT_TRUE(checker.check(full, encode_column_payload(bytes)));
    EXPECT_TRUE(checker.check(full, encode_column_payload(bytes, 1))) << "zstd's level is its own";
    chunk.columns.limits.back().y256 += 1;
    encode_chunk(bytes, chunk);
    EXPECT_FALSE(checker.check(full, encode_column_payload(bytes)));
    EXPECT_FALSE(checker.check(answer(ChunkFormat::columns, ChunkStatus::uniform), {}));
}

TEST_F(ChunkCheckerTest, FindsOneWrongVertexOfAMesh) {
    const Grid& grid = world_->definition.grid;
    SurfaceNetsMesher mesher(world_->definition);
    Mesh mesh;
    mesher.mesh(mesh, stack_, y_, grid.height);
    ASSERT_GT(mesh.triangle_count(), 0U);
    const DracoSettings settings{.side = grid.side, .height_voxels = grid.height + 1};
    ChunkChecker checker(world_);
    const auto full = answer(ChunkFormat::draco, ChunkStatus::full);
    EXPECT_TRUE(checker.check(full, encode_draco(mesh, settings).value()));
    mesh.positions256[5].y += 8;  // one step of Draco's
    const auto wrong = checker.check(full, encode_draco(mesh, settings).value());
    ASSERT_FALSE(wrong);
    EXPECT_EQ(wrong.error().code, ErrorCode::corrupt);
    EXPECT_FALSE(checker.check(answer(ChunkFormat::draco, ChunkStatus::empty), {}));
}

TEST_F(ChunkCheckerTest, TheThreadCountsWhatIsWrong) {
    LocalCheck check(world_);
    EXPECT_TRUE(check.offer(answer(ChunkFormat::draco, ChunkStatus::empty), {}));
    ChunkAnswer below = answer(ChunkFormat::draco, ChunkStatus::uniform);
    below.key.y = -1;
    below.uniform = {{.material = stack_.palette[0].composition.storage[0].material,
                      .concentration = stack_.palette[0].composition.storage[0].concentration}};
    EXPECT_TRUE(check.offer(below, {}));
    check.finish();
    EXPECT_EQ(check.counts().checked, 2U);
    EXPECT_EQ(check.counts().wrong, 1U);
    EXPECT_NE(check.counts().first_wrong.find("chunk 0/1/"), std::string::npos);
}

TEST_F(ChunkCheckerTest, BuildsTheWorldThatTheServerNames) {
    WorldAnswer answer{.request_id = 1,
                       .toml = canonical_world_file(world_->definition),
                       .fingerprint = world_->fingerprint};
    const auto built = build_sent_world(answer, world_->fingerprint);
    ASSERT_TRUE(built) << built.error().message;
    EXPECT_EQ((*built)->definition, world_->definition);
    EXPECT_EQ(build_sent_world(answer, Hash128{}).error().code, ErrorCode::wrong_world);
    answer.fingerprint = {};
    EXPECT_EQ(build_sent_world(answer, Hash128{}).error().code, ErrorCode::wrong_world);
    answer.toml = "nonsense";
    EXPECT_EQ(build_sent_world(answer, Hash128{}).error().code, ErrorCode::invalid_argument);
}

}  // namespace
}  // namespace terrane
