#include "server/chunks/build_chunk.h"

#include "generator/mesh/draco_codec.h"
#include "generator/mesh/glb.h"
#include "generator/mesh/water_surface.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "generator/volume/chunk.h"
#include "generator/volume/chunk_codec.h"
#include "generator/volume/limit.h"
#include "generator/volume/stack.h"
#include "generator/world/world_definition.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/wire/column_payload.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"
#include "server/chunks/answer.h"
#include "server/chunks/chunk_cache.h"
#include "server/chunks/chunk_key.h"
#include "server/chunks/chunk_record.h"
#include "server/chunks/counters.h"
#include "server/chunks/in_flight.h"
#include "server/chunks/store_identity.h"
#include "server/render/drawing.h"
#include "server/render/map_tile.h"
#include "server/render/picture_keys.h"
#include "server/render/section.h"
#include "storage/chunk_store.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace terrane {

namespace {

/// Times one stage after another.
class StageClock {
  public:
    std::uint32_t lap_us() {
        const auto now = std::chrono::steady_clock::now();
        const auto us = std::chrono::duration_cast<std::chrono::microseconds>(now - last_).count();
        last_ = now;
        return static_cast<std::uint32_t>(
            std::min<std::int64_t>(us, std::numeric_limits<std::uint32_t>::max()));
    }

  private:
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

tl::unexpected<Error> stopped() {
    return fail(ErrorCode::cancelled, "nobody waits for it any more");
}

RecordKey mesh_record_key(const ChunkKey& key) {
    return {.family = Family::meshes,
            .format = static_cast<std::uint8_t>(key.format),
            .position = key.position};
}

/// A level's stack is one chunk, so a tile above level 0 is that chunk's record.
RecordKey tile_record_key(const TileKey& key) {
    constexpr std::uint8_t kLevel0Tile = 16;
    constexpr std::uint8_t kCentredTile = 17;
    const StackPos at = key.position;
    const auto glb = static_cast<std::uint8_t>(ChunkFormat::glb);
    return {.family = Family::meshes,
            .format = key.centred   ? kCentredTile
                      : at.lod == 0 ? kLevel0Tile
                                    : glb,
            .position = {.lod = at.lod, .x = at.x, .y = 0, .z = at.z}};
}

/// More than a column's message takes: FlatBuffers' tables, offsets and padding included.
std::size_t head_bytes_of(const Stack& stack, std::span<const Limit> limits) {
    constexpr std::size_t kBesideBytes = 256;
    constexpr std::size_t kLimitBytes = 96;
    constexpr std::size_t kShareBytes = 32;
    std::size_t size_bytes = kBesideBytes;
    for (const Limit& limit : limits) {
        size_bytes +=
            kLimitBytes + kShareBytes * stack.palette[limit.palette_id].composition.shares().size();
    }
    return size_bytes;
}

std::shared_ptr<const EncodedChunk> file_of(Bytes bytes) {
    EncodedChunk file;
    file.status = ChunkStatus::full;
    file.payload = std::make_shared<const Bytes>(std::move(bytes));
    file.etag = etag_of(file);
    return std::make_shared<const EncodedChunk>(std::move(file));
}

/// The least column of a square of one stack's size around column (0, 0).
ColumnPos first_centred_column(std::int32_t lod, std::int32_t side) {
    const std::int64_t half = (std::int64_t{side} << lod) / 2;
    return {.x = -half, .z = -half};
}

/// No surface can be there: below the base, or above the highest world that is allowed.
bool beyond_every_surface(std::int32_t y, std::int32_t height) {
    return y < 0 || static_cast<std::int64_t>(y) * height > kHeightBoundMax + 1;
}

}  // namespace

Hash128 content_id_of(const World& world) {
    Bytes bytes;
    ByteWriter out(bytes);
    out.fixed(world.fingerprint.high);
    out.fixed(world.fingerprint.low);
    out.fixed(kEncodingVersion);
    return hash128(bytes);
}

std::int32_t tile_height_voxels(const World& world) {
    return static_cast<std::int32_t>(world.stack.height_bound) + 2;
}

ChunkBuilder::ChunkBuilder(const BuildContext& context)
    : context_(context),
      generator_(*context.world),
      mesher_(context.world->definition),
      blocky_mesher_(context.world->definition),
      tile_mesher_(context.world->definition),
      tile_height_voxels_(tile_height_voxels(*context.world)) {}

Result<Answer> ChunkBuilder::build(const Task& task) {
    if (const auto* chunk = std::get_if<ChunkKey>(&task.key)) {
        return build_chunk(task, *chunk);
    }
    if (const auto* column = std::get_if<ColumnPos>(&task.key)) {
        return build_column(task, *column);
    }
    if (const auto* tile = std::get_if<TileKey>(&task.key)) {
        return build_tile(task, *tile);
    }
    return build_picture(task);
}

Result<Answer> ChunkBuilder::build_chunk(const Task& task, const ChunkKey& key) {
    ServedChunk answer{.key = key, .chunk = nullptr, .source = ChunkSource::store, .timings = {}};
    const bool is_mesh = key.format != ChunkFormat::columns;
    if (is_mesh) {
        if (auto known = stored_mesh(mesh_record_key(key))) {
            answer.chunk = std::move(known);
            return answer;
        }
    }
    StageClock clock;
    const auto in_hand = stack_for(task, stack_of(key.position));
    if (!in_hand) {
        return tl::unexpected(in_hand.error());
    }
    answer.timings.generate_us = clock.lap_us();
    answer.source = in_hand->generated ? ChunkSource::generated : ChunkSource::store;
    if (task.stop.stop_requested()) {
        return stopped();
    }
    auto encoded = is_mesh ? encode_mesh(task, key, *in_hand->stack, answer.timings)
                           : encode_columns(key, *in_hand->stack, answer.timings);
    if (!encoded) {
        return tl::unexpected(encoded.error());
    }
    encoded->etag = etag_of(*encoded);
    answer.chunk = std::make_shared<const EncodedChunk>(*std::move(encoded));
    if (is_mesh) {
        write_record(mesh_record_key(key), encode_chunk_record(*answer.chunk));
    }
    return answer;
}

Result<Answer> ChunkBuilder::build_column(const Task& task, ColumnPos column) {
    const std::int32_t side = context_.world->definition.grid.side;
    const auto in_hand = stack_for(task, stack_of(column, side));
    if (!in_hand) {
        return tl::unexpected(in_hand.error());
    }
    const Stack& stack = *in_hand->stack;
    auto limits = std::make_shared<std::vector<ColumnLimit>>();
    const auto x = static_cast<std::int32_t>(floor_mod(column.x, side));
    const auto z = static_cast<std::int32_t>(floor_mod(column.z, side));
    if (const auto column_limits = stack.columns.column(x, z);
        column_limits.size() > kWireLimitsMax ||
        head_bytes_of(stack, column_limits) > kOutboundHeadBytesMax) {
        return fail(ErrorCode::too_large, "a column of " + std::to_string(column_limits.size()) +
                                              " limits is too large for one message");
    }
    for (const Limit& limit : stack.columns.column(x, z)) {
        limits->push_back({.y256 = limit.y256,
                           .flow = limit.flow,
                           .composition = stack.palette[limit.palette_id].composition});
    }
    return ServedColumn{.column = column,
                        .limits = std::move(limits),
                        .source = in_hand->generated ? ChunkSource::generated : ChunkSource::store};
}

Result<ChunkBuilder::StackInHand> ChunkBuilder::stack_for(const Task& task, StackPos position) {
    if (auto known = context_.stacks->get(position)) {
        raise(context_.counters->stack_hits);
        const bool generated = generated_job_ == task.job && generated_position_ == position;
        return StackInHand{.stack = std::move(known), .generated = generated};
    }
    auto stack = stored_stack(position);
    const bool generated = stack == nullptr;
    if (generated) {
        if (task.stop.stop_requested()) {
            return stopped();
        }
        if (const auto made = generator_.generate(stack_, position); !made) {
            return tl::unexpected(made.error());
        }
        raise(context_.counters->generations);
        generated_job_ = task.job;
        generated_position_ = position;
        stack = std::make_shared<const Stack>(stack_);  // a copy: exactly as large as it must be
        encode_stack(bytes_, *stack);
        write_record(stack_record_key(position), bytes_);
    }
    context_.stacks->put(position, stack, memory_bytes(*stack));
    return StackInHand{.stack = std::move(stack), .generated = generated};
}

std::shared_ptr<const Stack> ChunkBuilder::stored_stack(StackPos position) {
    const RecordKey key = stack_record_key(position);
    const auto bytes = read_record(key);
    if (!bytes) {
        return nullptr;
    }
    auto stack = decode_stack(*bytes, context_.world->definition.materials.size());
    if (stack &&
        (stack->position != position || stack->side != context_.world->definition.grid.side)) {
        stack = fail(ErrorCode::corrupt, "it is another stack's");
    }
    if (!stack) {
        corrupt_record("stack", key, stack.error());
        return nullptr;
    }
    raise(context_.counters->store_hits);
    return std::make_shared<const Stack>(*std::move(stack));
}

std::shared_ptr<const EncodedChunk> ChunkBuilder::stored_mesh(const RecordKey& key) {
    const auto bytes = read_record(key);
    if (!bytes) {
        return nullptr;
    }
    auto encoded = decode_chunk_record(*bytes, context_.world->definition.materials.size());
    if (!encoded) {
        corrupt_record("mesh", key, encoded.error());
        return nullptr;
    }
    raise(context_.counters->store_hits);
    return std::make_shared<const EncodedChunk>(*std::move(encoded));
}

Result<EncodedChunk> ChunkBuilder::encode_columns(const ChunkKey& key, const Stack& stack,
                                                  AnswerTimings& timings) {
    StageClock clock;
    cut_chunk(chunk_, stack, key.position.y, context_.world->definition.grid.height);
    EncodedChunk encoded;
    if (chunk_.uniform) {
        encoded.status = ChunkStatus::uniform;
        encoded.uniform = chunk_.uniform_content.composition;
    } else {
        encode_chunk(bytes_, chunk_, key.without_flow ? FlowPlane::without : FlowPlane::with);
        if (bytes_.size() > kColumnChunkBytesMax) {
            return fail(ErrorCode::too_large,
                        "columns of " + std::to_string(bytes_.size()) + " bytes");
        }
        encoded.status = ChunkStatus::full;
        encoded.payload = std::make_shared<const Bytes>(encode_column_payload(bytes_));
        if (encoded.payload->size() > kPayloadBytesMax) {
            return fail(
                ErrorCode::too_large,
                "columns of " + std::to_string(encoded.payload->size()) + " compressed bytes");
        }
    }
    timings.encode_us = clock.lap_us();
    return encoded;
}

/// Leaves mesh_ empty where no surface can be.
void ChunkBuilder::make_mesh(const ChunkKey& key, const Stack& stack) {
    const std::int32_t y = key.position.y;
    const std::int32_t height = context_.world->definition.grid.height;
    mesh_.clear();
    if (key.position.lod > 0) {
        tile_mesher_.mesh(mesh_, stack, true);
    } else if (beyond_every_surface(y, height)) {
        return;
    } else if (key.format == ChunkFormat::draco_blocky) {
        blocky_mesher_.mesh(mesh_, stack, y, height);
    } else {
        mesher_.mesh(mesh_, stack, y, height);
    }
}

Result<EncodedChunk> ChunkBuilder::encode_mesh(const Task& task, const ChunkKey& key,
                                               const Stack& stack, AnswerTimings& timings) {
    const Grid& grid = context_.world->definition.grid;
    StageClock clock;
    make_mesh(key, stack);
    timings.mesh_us = clock.lap_us();
    EncodedChunk encoded;
    if (mesh_.triangle_count() == 0) {
        cut_chunk(chunk_, stack, key.position.y, grid.height);
        encoded.status = chunk_.uniform ? ChunkStatus::uniform : ChunkStatus::empty;
        if (chunk_.uniform) {
            encoded.uniform = chunk_.uniform_content.composition;
        }
        timings.encode_us = clock.lap_us();
        return encoded;
    }
    if (task.stop.stop_requested()) {
        return stopped();
    }
    const std::int32_t height_voxels = key.position.lod > 0 ? tile_height_voxels_ : grid.height + 1;
    const DracoSettings settings{.side = grid.side, .height_voxels = height_voxels};
    auto payload = key.format == ChunkFormat::glb
                       ? encode_glb(mesh_, settings,
                                    glb_place_of(first_column_of(stack.position, grid.side),
                                                 std::int64_t{key.position.y} * grid.height,
                                                 key.position.lod, grid.voxel_size_m))
                       : encode_draco(mesh_, settings);
    if (!payload) {
        return tl::unexpected(payload.error());
    }
    if (payload->size() > kPayloadBytesMax) {
        return fail(ErrorCode::too_large, "mesh of " + std::to_string(payload->size()) + " bytes");
    }
    encoded.status = ChunkStatus::full;
    encoded.payload = std::make_shared<const Bytes>(*std::move(payload));
    timings.encode_us = clock.lap_us();
    return encoded;
}

Result<Answer> ChunkBuilder::build_tile(const Task& task, const TileKey& key) {
    const RecordKey record = tile_record_key(key);
    if (auto known = stored_mesh(record)) {
        return ServedFile{.file = std::move(known), .source = ChunkSource::store};
    }
    StackInHand in_hand{.stack = nullptr, .generated = true};
    if (!key.centred) {
        auto stack = stack_for(task, key.position);
        if (!stack) {
            return tl::unexpected(stack.error());
        }
        in_hand = *std::move(stack);
    }
    if (auto made = make_tile_mesh(key, in_hand.stack.get()); !made) {
        return tl::unexpected(made.error());
    }
    if (task.stop.stop_requested()) {
        return stopped();
    }
    const Grid& grid = context_.world->definition.grid;
    const std::int32_t lod = key.position.lod;
    const ColumnPos first = key.centred ? first_centred_column(lod, grid.side)
                                        : first_column_of(key.position, grid.side);
    auto payload = encode_glb(mesh_, {.side = grid.side, .height_voxels = tile_height_voxels_},
                              glb_place_of(first, 0, lod, grid.voxel_size_m));
    if (!payload) {
        return tl::unexpected(payload.error());
    }
    if (payload->size() > kPayloadBytesMax) {
        return fail(ErrorCode::too_large, "tile of " + std::to_string(payload->size()) + " bytes");
    }
    auto file = file_of(*std::move(payload));
    write_record(record, encode_chunk_record(*file));
    return ServedFile{.file = std::move(file),
                      .source = in_hand.generated ? ChunkSource::generated : ChunkSource::store};
}

/// `stack` is null for the centred tile, which is none.
Result<void> ChunkBuilder::make_tile_mesh(const TileKey& key, const Stack* stack) {
    const std::int32_t side = context_.world->definition.grid.side;
    if (key.centred) {
        const std::int32_t lod = key.position.lod;
        const ColumnPos first = first_centred_column(lod, side);
        const std::int64_t step = std::int64_t{1} << lod;
        ColumnSet set;  // with the apron that a stack has
        if (auto made = generator_.generate(set, {.x0 = first.x - step,
                                                  .z0 = first.z - step,
                                                  .width = side + 2,
                                                  .length = side + 2,
                                                  .lod = lod});
            !made) {
            return made;
        }
        raise(context_.counters->generations);
        set.columns.x_first = -1;
        set.columns.z_first = -1;
        stack_ = {.position = key.position,
                  .side = side,
                  .columns = std::move(set.columns),
                  .palette = std::move(set.palette),
                  .highest_y256 = set.highest_y256};
        stack = &stack_;
    }
    if (key.position.lod > 0) {
        tile_mesher_.mesh(mesh_, *stack, true);
    } else {
        mesher_.mesh(mesh_, *stack, HeightRange{.first = 0, .last = tile_height_voxels_ - 1});
        add_side_skirts(mesh_, side);
    }
    return {};
}

Result<Answer> ChunkBuilder::build_picture(const Task& task) {
    const auto* map = std::get_if<MapTile>(&task.key);
    const Drawing drawing{.world = context_.world, .generator = &generator_, .stop = task.stop};
    auto image = map != nullptr ? draw_map_tile(drawing, *map)
                                : draw_section(drawing, std::get<Section>(task.key));
    if (!image) {
        return tl::unexpected(image.error());
    }
    auto png = encode_png(*image);
    if (!png) {
        return tl::unexpected(png.error());
    }
    return ServedFile{.file = file_of(*std::move(png)), .source = ChunkSource::generated};
}

std::optional<Bytes> ChunkBuilder::read_record(const RecordKey& key) {
    auto found = context_.store->get(key);
    if (!found) {
        store_failed(found.error());
        return std::nullopt;
    }
    return *std::move(found);
}

void ChunkBuilder::write_record(const RecordKey& key, std::span<const std::byte> value) {
    const RecordToPut record{.key = key, .value = value};
    if (const auto written = context_.store->put(std::span(&record, 1)); !written) {
        store_failed(written.error());
    }
}

void ChunkBuilder::store_failed(const Error& error) {
    raise(context_.counters->store_failures);
    if (context_.on_store_failure) {
        context_.on_store_failure(error.message);
    }
}

void ChunkBuilder::corrupt_record(std::string_view what, const RecordKey& key, const Error& error) {
    raise(context_.counters->store_corrupt);
    if (context_.on_notice) {
        const ChunkPos at = key.position;
        context_.on_notice("the store's record of " + std::string(what) + " " +
                           std::to_string(at.lod) + "/" + std::to_string(at.x) + "/" +
                           std::to_string(at.y) + "/" + std::to_string(at.z) +
                           " can't be read and is made anew: " + error.message);
    }
}

}  // namespace terrane
