// The real pipeline: generator, codecs, meshes and the memory store.
#include "server/chunks/build_chunk.h"

#include "generator/mesh/draco_codec.h"
#include "generator/mesh/glb.h"
#include "generator/volume/chunk_codec.h"
#include "protocol/wire/column_payload.h"
#include "storage/memory_store.h"
#include "tests/support/test_world.h"

#include <gtest/gtest.h>

#include <limits>

namespace terrane {
namespace {

/// The memory store, with faults on demand.
class FaultyStore final : public ChunkStore {
  public:
    explicit FaultyStore(const StoreIdentity& identity) : store_(identity) {}

    Result<std::optional<Bytes>> get(const RecordKey& key) override {
        if (fail_reads) {
            return fail(ErrorCode::io_error, "read refused on purpose");
        }
        auto found = store_.get(key);
        if (found && *found && spoil_reads) {
            (**found)[(**found).size() / 2] ^= std::byte{0x10};
            (**found).resize((**found).size() - 1);
        }
        return found;
    }

    Result<std::vector<std::optional<Bytes>>> get_many(std::span<const RecordKey> keys) override {
        return store_.get_many(keys);
    }

    Result<void> put(std::span<const RecordToPut> records) override {
        if (fail_writes) {
            return fail(ErrorCode::io_error, "write refused on purpose");
        }
        return store_.put(records);
    }

    Result<void> erase(const RecordKey& key) override { return store_.erase(key); }

    Result<void> flush() override { return store_.flush(); }

    StoreStats stats() const override { return store_.stats(); }

    bool fail_reads = false;
    bool fail_writes = false;
    bool spoil_reads = false;

  private:
    MemoryStore store_;
};

/// One server's worth of shared things; `restart` forgets all but the store.
struct Pipeline {
    explicit Pipeline(const char* name = "paper-B2") : world(load_shipped_world(name)) {
        store = std::make_unique<FaultyStore>(StoreIdentity{.fingerprint = world->fingerprint,
                                                            .content_id = content_id_of(*world),
                                                            .generator_version = kGeneratorVersion,
                                                            .world_name = world->definition.name});
        restart();
    }

    void restart() {
        builder.reset();
        stacks = std::make_unique<StackCache>(std::size_t{64} << 20U);
        builder = std::make_unique<ChunkBuilder>(
            BuildContext{.world = world.get(),
                         .store = store.get(),
                         .stacks = stacks.get(),
                         .counters = &counters,
                         .on_notice = [this](std::string_view) { ++notices; }});
    }

    Result<Answer> build(const WorkKey& key, std::stop_token stop = {}) {
        ++last_job;
        return builder->build(
            {.id = last_job, .job = last_job, .key = key, .stop = std::move(stop), .asked = {}});
    }

    ServedChunk chunk(const ChunkKey& key) {
        const auto answer = build(key);
        EXPECT_TRUE(answer) << answer.error().message;
        return std::get<ServedChunk>(*answer);
    }

    std::uint64_t generations() const { return count_of(counters.generations); }

    std::shared_ptr<const World> world;
    std::unique_ptr<FaultyStore> store;
    std::unique_ptr<StackCache> stacks;
    ServiceCounters counters;
    std::unique_ptr<ChunkBuilder> builder;
    int notices = 0;
    JobId last_job = 0;
};

ChunkKey key_of(std::int32_t y, ChunkFormat format, bool without_flow = false) {
    return {.position = {.lod = 0, .x = 3, .y = y, .z = -2},
            .format = format,
            .without_flow = without_flow};
}

std::int32_t highest_chunk(const World& world) {
    return static_cast<std::int32_t>(world.stack.height_bound) / world.definition.grid.height;
}

TEST(BuildChunk, AfterARestartEverythingComesFromTheStore) {
    Pipeline p;
    std::vector<ServedChunk> first;
    int full = 0;
    int uniform = 0;
    const std::int32_t top = highest_chunk(*p.world) + 1;
    for (std::int32_t y = -1; y <= top; ++y) {
        first.push_back(p.chunk(key_of(y, ChunkFormat::draco)));
        full += first.back().chunk->status == ChunkStatus::full ? 1 : 0;
        uniform += first.back().chunk->status == ChunkStatus::uniform ? 1 : 0;
    }
    EXPECT_EQ(first[0].source, ChunkSource::generated);
    EXPECT_EQ(p.generations(), 1U) << "one stack, however many of its heights";
    EXPECT_GT(full, 0);
    EXPECT_GT(uniform, 0);
    p.restart();
    for (std::int32_t y = -1; y <= top; ++y) {
        const ServedChunk again = p.chunk(key_of(y, ChunkFormat::draco));
        const ServedChunk& before = first[static_cast<std::size_t>(y + 1)];
        EXPECT_EQ(again.source, ChunkSource::store);
        EXPECT_EQ(again.chunk->status, before.chunk->status);
        EXPECT_EQ(again.chunk->etag, before.chunk->etag);
        EXPECT_EQ(again.chunk->uniform, before.chunk->uniform);
    }
    const ServedChunk columns = p.chunk(key_of(0, ChunkFormat::columns));
    EXPECT_EQ(columns.source, ChunkSource::store);
    EXPECT_EQ(p.generations(), 1U);
}

TEST(BuildChunk, BlocksAreWhatTheBlockyMesherMakesAndARecordOfTheirOwn) {
    Pipeline p;
    const Grid& grid = p.world->definition.grid;
    StackGenerator generator(*p.world);
    BlockyMesher mesher(p.world->definition);
    Stack stack;
    ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = 3, .z = -2}));
    Mesh mesh;
    std::vector<Hash128> etags;
    int full = 0;
    for (std::int32_t y = -1; y <= highest_chunk(*p.world); ++y) {
        const ServedChunk smooth = p.chunk(key_of(y, ChunkFormat::draco));
        const ServedChunk served = p.chunk(key_of(y, ChunkFormat::draco_blocky));
        mesher.mesh(mesh, stack, y, grid.height);
        ASSERT_EQ(served.chunk->status == ChunkStatus::full, mesh.triangle_count() > 0) << y;
        if (served.chunk->status == ChunkStatus::full) {
            const auto decoded = decode_draco(*served.chunk->payload);
            ASSERT_TRUE(decoded);
            EXPECT_EQ(decoded->triangle_count(), mesh.triangle_count());
            EXPECT_NE(served.chunk->etag, smooth.chunk->etag);
            ++full;
        }
        etags.push_back(served.chunk->etag);
    }
    EXPECT_GT(full, 0);
    p.restart();
    for (std::int32_t y = -1; y <= highest_chunk(*p.world); ++y) {
        const ServedChunk again = p.chunk(key_of(y, ChunkFormat::draco_blocky));
        EXPECT_EQ(again.source, ChunkSource::store);
        EXPECT_EQ(again.chunk->etag, etags[static_cast<std::size_t>(y + 1)]);
    }
}

std::string_view glb_json(const Bytes& glb) {
    const std::string_view text = text_of(glb);
    return text.substr(20, text.find("BIN") - 24);
}

TEST(BuildChunk, AGlbHasTheTrianglesOfTheDracoMeshAtTheChunksPlace) {
    Pipeline p;
    StackGenerator generator(*p.world);
    SurfaceNetsMesher mesher(p.world->definition);
    Stack stack;
    ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = 3, .z = -2}));
    int full = 0;
    for (std::int32_t y = -1; y <= highest_chunk(*p.world); ++y) {
        const ServedChunk draco = p.chunk(key_of(y, ChunkFormat::draco));
        const ServedChunk glb = p.chunk(key_of(y, ChunkFormat::glb));
        ASSERT_EQ(glb.chunk->status, draco.chunk->status) << y;
        EXPECT_EQ(glb.chunk->uniform, draco.chunk->uniform);
        if (glb.chunk->status != ChunkStatus::full) {
            continue;
        }
        ++full;
        const Grid& grid = p.world->definition.grid;
        const auto place = glb_place_of({.x = 3 * grid.side, .z = -2 * grid.side},
                                        std::int64_t{y} * grid.height, 0, grid.voxel_size_m);
        Mesh mesh;
        mesher.mesh(mesh, stack, y, grid.height);
        EXPECT_EQ(*glb.chunk->payload,
                  encode_glb(mesh, {.side = grid.side, .height_voxels = grid.height + 1}, place));
        EXPECT_NE(glb_json(*glb.chunk->payload).find("KHR_draco_mesh_compression"),
                  std::string_view::npos);
    }
    EXPECT_GT(full, 0);
    p.restart();
    EXPECT_EQ(p.chunk(key_of(0, ChunkFormat::glb)).source, ChunkSource::store);
}

ServedFile file(Pipeline& p, const WorkKey& key) {
    const auto answer = p.build(key);
    EXPECT_TRUE(answer) << answer.error().message;
    return std::get<ServedFile>(*answer);
}

TEST(BuildChunk, TilesAreFilesOfTheirOwnAndSurviveARestart) {
    Pipeline p;
    const std::vector<TileKey> keys = {{.position = {.lod = 0, .x = 3, .z = -2}},
                                       {.position = {.lod = 1, .x = 3, .z = -2}},
                                       {.position = {.lod = 17, .x = 0, .z = 0}},
                                       {.position = {.lod = 17, .x = 0, .z = 0}, .centred = true}};
    std::vector<Hash128> etags;
    for (const TileKey& key : keys) {
        const ServedFile made = file(p, key);
        EXPECT_EQ(made.source, ChunkSource::generated);
        EXPECT_EQ(made.file->status, ChunkStatus::full);
        etags.push_back(made.file->etag);
    }
    EXPECT_EQ(p.generations(), 4U);
    EXPECT_NE(etags[2], etags[3]);
    // Above level 0 a chunk is the whole stack: one record for both.
    const ServedChunk chunk =
        p.chunk({.position = {.lod = 1, .x = 3, .y = 0, .z = -2}, .format = ChunkFormat::glb});
    EXPECT_EQ(chunk.source, ChunkSource::store);
    EXPECT_EQ(chunk.chunk->etag, etags[1]);
    p.restart();
    for (std::size_t i = 0; i < keys.size(); ++i) {
        const ServedFile again = file(p, keys[i]);
        EXPECT_EQ(again.source, ChunkSource::store);
        EXPECT_EQ(again.file->etag, etags[i]);
    }
    EXPECT_EQ(p.generations(), 4U);
}

TEST(BuildChunk, TheCentredTileLiesAroundTheOrigin) {
    Pipeline p;
    const ServedFile made =
        file(p, TileKey{.position = {.lod = 5, .x = 0, .z = 0}, .centred = true});
    const std::string_view json = glb_json(*made.file->payload);
    EXPECT_NE(json.find("\"translation\":[0,"), std::string_view::npos) << json;
}

TEST(BuildChunk, PicturesArePngFiles) {
    Pipeline p;
    for (const WorkKey& key :
         {WorkKey(MapTile{.zoom = 18, .x = 1 << 17, .y = 1 << 17}),
          WorkKey(Section{.from = {.x = -20, .z = 5}, .to = {.x = 20, .z = 9}, .scale = 2})}) {
        const ServedFile made = file(p, key);
        EXPECT_EQ(text_of(*made.file->payload).substr(0, 4), "\x89PNG");
        EXPECT_EQ(file(p, key).file->etag, made.file->etag);
    }
    std::stop_source source;
    source.request_stop();
    const auto stopped = p.build(MapTile{}, source.get_token());
    ASSERT_FALSE(stopped);
    EXPECT_EQ(stopped.error().code, ErrorCode::cancelled);
}

TEST(BuildChunk, AMeshIsWhatTheMesherMakes) {
    Pipeline p;
    const Grid& grid = p.world->definition.grid;
    StackGenerator generator(*p.world);
    SurfaceNetsMesher mesher(p.world->definition);
    Stack stack;
    ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = 3, .z = -2}));
    Mesh mesh;
    for (std::int32_t y = 0; y <= highest_chunk(*p.world); ++y) {
        const ServedChunk served = p.chunk(key_of(y, ChunkFormat::draco));
        mesher.mesh(mesh, stack, y, grid.height);
        ASSERT_EQ(served.chunk->status == ChunkStatus::full, mesh.triangle_count() > 0) << y;
        if (served.chunk->status == ChunkStatus::full) {
            const auto decoded = decode_draco(*served.chunk->payload);
            ASSERT_TRUE(decoded);
            EXPECT_EQ(decoded->triangle_count(), mesh.triangle_count());
            EXPECT_EQ(served.chunk->etag, hash128(*served.chunk->payload));
        }
    }
}

TEST(BuildChunk, ColumnsAreWhatTheCutGives) {
    Pipeline p;
    StackGenerator generator(*p.world);
    Stack stack;
    ASSERT_TRUE(generator.generate(stack, {.lod = 0, .x = 3, .z = -2}));
    Chunk chunk;
    cut_chunk(chunk, stack, 0, p.world->definition.grid.height);
    Bytes expected;
    encode_chunk(expected, chunk);
    const ServedChunk with = p.chunk(key_of(0, ChunkFormat::columns));
    ASSERT_EQ(with.chunk->status, ChunkStatus::full);
    EXPECT_EQ(*decode_column_payload(*with.chunk->payload, 1U << 24U), expected);
    const ServedChunk without = p.chunk(key_of(0, ChunkFormat::columns, true));
    EXPECT_LT(without.chunk->payload->size(), with.chunk->payload->size());
    encode_chunk(expected, chunk, FlowPlane::without);
    EXPECT_EQ(*decode_column_payload(*without.chunk->payload, 1U << 24U), expected);
}

TEST(BuildChunk, AColumnIsTheStacksColumn) {
    Pipeline p;
    const std::int32_t side = p.world->definition.grid.side;
    const ColumnPos at{.x = -1, .z = 5};
    const auto answer = p.build(at);
    ASSERT_TRUE(answer);
    const auto& limits = *std::get<ServedColumn>(*answer).limits;
    StackGenerator generator(*p.world);
    Stack stack;
    ASSERT_TRUE(generator.generate(stack, stack_of(at, side)));
    const auto expected = stack.columns.column(side - 1, 5);
    ASSERT_EQ(limits.size(), expected.size());
    for (std::size_t i = 0; i < limits.size(); ++i) {
        EXPECT_EQ(limits[i].y256, expected[i].y256);
        EXPECT_EQ(limits[i].flow, expected[i].flow);
        EXPECT_EQ(limits[i].composition, stack.palette[expected[i].palette_id].composition);
    }
}

TEST(BuildChunk, TheExtremesOfACoordinateAreAnswered) {
    Pipeline p;
    constexpr std::int32_t kMin = std::numeric_limits<std::int32_t>::min();
    constexpr std::int32_t kMax = std::numeric_limits<std::int32_t>::max();
    for (const std::int32_t x : {kMin, 0, kMax}) {
        for (const std::int32_t z : {kMin, 0, kMax}) {
            for (const std::int32_t y : {kMin, kMax, -1, 1 << 20}) {
                for (const auto format : {ChunkFormat::draco, ChunkFormat::columns}) {
                    const auto answer =
                        p.build(ChunkKey{.position = {.lod = 0, .x = x, .y = y, .z = z},
                                         .format = format,
                                         .without_flow = false});
                    ASSERT_TRUE(answer) << answer.error().message;
                    EXPECT_EQ(std::get<ServedChunk>(*answer).chunk->status, ChunkStatus::uniform);
                }
            }
        }
    }
}

TEST(BuildChunk, ARecordThatCanNotBeReadIsMadeAnewAndOverwritten) {
    Pipeline p;
    const ServedChunk mesh = p.chunk(key_of(0, ChunkFormat::draco));
    p.restart();
    p.store->spoil_reads = true;
    const ServedChunk again = p.chunk(key_of(0, ChunkFormat::draco));
    EXPECT_EQ(again.source, ChunkSource::generated);
    EXPECT_EQ(again.chunk->etag, mesh.chunk->etag);
    EXPECT_EQ(count_of(p.counters.store_corrupt), 2U) << "the mesh and the stack";
    EXPECT_EQ(p.notices, 2);
    p.restart();
    p.store->spoil_reads = false;
    EXPECT_EQ(p.chunk(key_of(0, ChunkFormat::draco)).source, ChunkSource::store);
    EXPECT_EQ(p.generations(), 2U);
}

TEST(BuildChunk, AStoreThatFailsOnlyCostsTime) {
    Pipeline p;
    p.store->fail_reads = true;
    p.store->fail_writes = true;
    for (const auto format : {ChunkFormat::draco, ChunkFormat::columns}) {
        p.restart();
        EXPECT_EQ(p.chunk(key_of(0, format)).source, ChunkSource::generated);
    }
    EXPECT_EQ(p.generations(), 2U);
    EXPECT_EQ(count_of(p.counters.store_failures), 4U + 2U)
        << "mesh and stack read and written, then a stack";
}

TEST(BuildChunk, StopsBetweenItsStages) {
    Pipeline p;
    std::stop_source stop;
    stop.request_stop();
    const auto answer = p.build(key_of(0, ChunkFormat::draco), stop.get_token());
    ASSERT_FALSE(answer);
    EXPECT_EQ(answer.error().code, ErrorCode::cancelled);
    EXPECT_EQ(p.generations(), 0U);
}

}  // namespace
}  // namespace terrane
