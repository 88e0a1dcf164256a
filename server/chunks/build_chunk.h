// The pipeline from a key to an answer, pure but for the store:
//
//     mesh record in the store ── found ─────────────────────────────────────────────> answer
//       └ stack: in memory | record in the store | generate, store.put ─> cut the chunk
//           ├ columns: encode_chunk ─> payload (tag, zstd) ────────────────────────────> answer
//           └ draco, blocky, glb: a mesher ─> encode_draco or encode_glb ─> store.put ─> answer
//
// A store only saves time: what it refuses to read or write is counted and served all the same, and
// a record that can't be read back is made anew and overwritten.
#pragma once

#include "generator/mesh/blocky.h"
#include "generator/mesh/height_field.h"
#include "generator/mesh/surface_nets.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "generator/volume/chunk.h"
#include "protocol/base/hash.h"
#include "server/chunks/answer.h"
#include "server/chunks/chunk_cache.h"
#include "server/chunks/counters.h"
#include "server/chunks/in_flight.h"
#include "storage/chunk_store.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

namespace terrane {

/// Names what is served of a world: its fingerprint and how this build encodes it.
Hash128 content_id_of(const World& world);

/// Voxels that the tallest tile of a whole stack may span, from y = -1 up: the same for every tile
/// of a world.
std::int32_t tile_height_voxels(const World& world);

/// What all builders of a server share; everything outlives them and may be used from any thread.
struct BuildContext {
    const World* world = nullptr;
    ChunkStore* store = nullptr;
    StackCache* stacks = nullptr;
    ServiceCounters* counters = nullptr;
    /// Told about each record that could not be read, in a sentence; may be empty. Must not throw.
    std::function<void(std::string_view)> on_notice;
    /// Told about each read or write that the store refused; may be empty. Must not throw.
    std::function<void(std::string_view)> on_store_failure = {};
};

/// One worker's pipeline and its scratch buffers. Belongs to one thread.
class ChunkBuilder {
  public:
    explicit ChunkBuilder(const BuildContext& context);

    /// Fails with `cancelled` when the task's stop is seen between two stages, else with what the
    /// generator or the encoder says.
    Result<Answer> build(const Task& task);

  private:
    struct StackInHand {
        std::shared_ptr<const Stack> stack;
        bool generated = false;  ///< made for this task's job
    };

    Result<Answer> build_chunk(const Task& task, const ChunkKey& key);
    Result<Answer> build_column(const Task& task, ColumnPos column);
    Result<Answer> build_tile(const Task& task, const TileKey& key);
    Result<Answer> build_picture(const Task& task);
    Result<void> make_tile_mesh(const TileKey& key, const Stack* stack);
    Result<StackInHand> stack_for(const Task& task, StackPos position);
    std::shared_ptr<const Stack> stored_stack(StackPos position);
    Result<EncodedChunk> encode_columns(const ChunkKey& key, const Stack& stack,
                                        AnswerTimings& timings);
    void make_mesh(const ChunkKey& key, const Stack& stack);
    Result<EncodedChunk> encode_mesh(const Task& task, const ChunkKey& key, const Stack& stack,
                                     AnswerTimings& timings);
    std::shared_ptr<const EncodedChunk> stored_mesh(const RecordKey& key);
    std::optional<Bytes> read_record(const RecordKey& key);
    void write_record(const RecordKey& key, std::span<const std::byte> value);
    void store_failed(const Error& error);
    void corrupt_record(std::string_view what, const RecordKey& key, const Error& error);

    BuildContext context_;
    StackGenerator generator_;
    SurfaceNetsMesher mesher_;
    BlockyMesher blocky_mesher_;
    HeightFieldMesher tile_mesher_;
    std::int32_t tile_height_voxels_;  ///< what the tallest tile of any level needs in Draco's box
    Stack stack_;                      // scratch from here on
    Chunk chunk_;
    Mesh mesh_;
    Bytes bytes_;
    JobId generated_job_ = 0;  ///< the last job whose stack was generated here
    StackPos generated_position_;
};

}  // namespace terrane
