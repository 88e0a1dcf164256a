#include "client-sample/cpp/program/local_check.h"

#include "generator/mesh/blocky.h"
#include "generator/mesh/draco_codec.h"
#include "generator/mesh/height_field.h"
#include "generator/mesh/mesh.h"
#include "generator/mesh/surface_nets.h"
#include "generator/terrain/generate_stack.h"
#include "generator/terrain/load_world.h"
#include "generator/terrain/world.h"
#include "generator/volume/chunk.h"
#include "generator/volume/chunk_codec.h"
#include "generator/volume/stack.h"
#include "generator/world/composition.h"
#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/hash.h"
#include "protocol/base/mutex.h"
#include "protocol/base/result.h"
#include "protocol/wire/column_payload.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <utility>

namespace terrane {

namespace {

std::string to_text(ChunkPos key) {
    return "chunk " + std::to_string(key.lod) + "/" + std::to_string(key.x) + "/" +
           std::to_string(key.y) + "/" + std::to_string(key.z);
}

tl::unexpected<Error> differs(const ChunkAnswer& answer, const std::string& what) {
    return fail(ErrorCode::corrupt, to_text(answer.key) + " as " +
                                        std::string(to_string(answer.format)) +
                                        " differs from what is generated here: " + what);
}

bool is_same(const WireComposition& wire, const Composition& composition, double tolerance) {
    const auto shares = composition.shares();
    if (wire.size() != shares.size()) {
        return false;
    }
    for (std::size_t i = 0; i < wire.size(); ++i) {
        if (wire[i].material != shares[i].material ||
            std::abs(wire[i].concentration - shares[i].concentration) > tolerance) {
            return false;
        }
    }
    return true;
}

/// What of two meshes differs first; empty if nothing.
std::string difference_of(const Mesh& a, const Mesh& b) {
    if (a.vertex_count() != b.vertex_count() || a.indices.size() != b.indices.size()) {
        return std::to_string(a.vertex_count()) + " vertices and " +
               std::to_string(a.triangle_count()) + " triangles for " +
               std::to_string(b.vertex_count()) + " and " + std::to_string(b.triangle_count());
    }
    return a.positions256 != b.positions256   ? "positions"
           : a.indices != b.indices           ? "indices"
           : a.normals != b.normals           ? "normals"
           : a.colors != b.colors             ? "colours"
           : a.material_ids != b.material_ids ? "materials"
                                              : "";
}

}  // namespace

Result<std::shared_ptr<const World>> build_sent_world(const WorldAnswer& answer,
                                                      const Hash128& fingerprint) {
    if (answer.fingerprint != fingerprint) {
        return fail(ErrorCode::wrong_world, "the server sent the file of world " +
                                                to_hex(answer.fingerprint) + ", it serves " +
                                                to_hex(fingerprint));
    }
    const std::string name = "the server's world file";
    LoadedWorld loaded = build_world(parse_world_file(answer.toml, name, {}), name);
    if (!loaded.ok()) {
        return fail(ErrorCode::invalid_argument, loaded.faults.empty()
                                                     ? name + " can't be built"
                                                     : loaded.faults.front().text());
    }
    if (loaded.world->fingerprint != fingerprint) {
        return fail(ErrorCode::wrong_world,
                    "the server's world file has the fingerprint " +
                        to_hex(loaded.world->fingerprint) + ", it says " + to_hex(fingerprint) +
                        ": another generator version, or not the world that it serves");
    }
    return std::move(loaded.world);
}

struct ChunkChecker::Buffers {
    explicit Buffers(const World& world)
        : generator(world),
          mesher(world.definition),
          blocky_mesher(world.definition),
          tile_mesher(world.definition) {}

    StackGenerator generator;
    SurfaceNetsMesher mesher;
    BlockyMesher blocky_mesher;
    HeightFieldMesher tile_mesher;
    Stack stack;
    Chunk chunk;
    Mesh mesh;
    Bytes bytes;
};

ChunkChecker::ChunkChecker(std::shared_ptr<const World> world, double share_tolerance)
    : world_(std::move(world)),
      share_tolerance_(share_tolerance),
      buffers_(std::make_unique<Buffers>(*world_)) {}

ChunkChecker::~ChunkChecker() = default;

Result<void> ChunkChecker::check(const ChunkAnswer& answer, std::span<const std::byte> payload) {
    Buffers& b = *buffers_;
    const Grid& grid = world_->definition.grid;
    const ChunkPos key = answer.key;
    if (const auto made = b.generator.generate(b.stack, stack_of(key)); !made) {
        return differs(answer, made.error().message);
    }
    cut_chunk(b.chunk, b.stack, key.y, grid.height);
    const bool is_uniform_right =
        b.chunk.uniform &&
        is_same(answer.uniform, b.chunk.uniform_content.composition, share_tolerance_);
    if (answer.format == ChunkFormat::columns) {
        if (answer.status != ChunkStatus::full) {
            return is_uniform_right ? Result<void>()
                                    : differs(answer, "it is not uniform like that");
        }
        const auto sent = decode_column_payload(payload, kColumnChunkBytesMax);
        encode_chunk(b.bytes, b.chunk);
        if (b.chunk.uniform || !sent || *sent != b.bytes) {
            return differs(answer, "the columns' bytes");
        }
        return {};
    }
    if (key.lod > 0) {
        b.tile_mesher.mesh(b.mesh, b.stack, true);
    } else if (answer.format == ChunkFormat::draco_blocky) {
        b.blocky_mesher.mesh(b.mesh, b.stack, key.y, grid.height);
    } else {
        b.mesher.mesh(b.mesh, b.stack, key.y, grid.height);
    }
    if (answer.status != ChunkStatus::full) {
        const bool is_right =
            b.mesh.triangle_count() == 0 &&
            (answer.status == ChunkStatus::uniform ? is_uniform_right : !b.chunk.uniform);
        return is_right ? Result<void>() : differs(answer, "it has a surface or another content");
    }
    if (b.mesh.triangle_count() == 0) {
        return differs(answer, "there is no surface in it");
    }
    const std::int32_t tile_height = static_cast<std::int32_t>(world_->stack.height_bound) + 2;
    const auto encoded = encode_draco(
        b.mesh, {.side = grid.side, .height_voxels = key.lod > 0 ? tile_height : grid.height + 1});
    const auto expected = encoded ? decode_draco(*encoded) : Result<Mesh>(Mesh());
    const auto sent = decode_draco(payload);
    if (!encoded || !expected || !sent) {
        return differs(answer, "it can't be encoded or decoded here");
    }
    const std::string difference = difference_of(*sent, *expected);
    return difference.empty() ? Result<void>() : differs(answer, difference);
}

LocalCheck::LocalCheck(std::shared_ptr<const World> world, double share_tolerance)
    : checker_(std::move(world), share_tolerance),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

LocalCheck::~LocalCheck() {
    {
        const MutexLock lock(mutex_);
        is_over_ = true;
        queue_.clear();
    }
    changed_.notify_all();
}

bool LocalCheck::offer(const ChunkAnswer& answer, std::span<const std::byte> payload) {
    {
        const MutexLock lock(mutex_);
        if (queue_.size() >= kChecksQueuedMax) {
            return false;
        }
        queue_.push_back({.answer = answer, .payload = {payload.begin(), payload.end()}});
    }
    changed_.notify_all();
    return true;
}

void LocalCheck::finish() {
    MutexLock lock(mutex_);
    while (!queue_.empty() || is_checking_) {
        lock.wait(changed_);
    }
}

CheckCounts LocalCheck::counts() const {
    const MutexLock lock(mutex_);
    return counts_;
}

void LocalCheck::run(const std::stop_token& stop) {
    for (;;) {
        Waiting waiting;
        {
            MutexLock lock(mutex_);
            while (queue_.empty() && !is_over_) {
                lock.wait(changed_);
            }
            if (is_over_ || stop.stop_requested()) {
                return;
            }
            waiting = std::move(queue_.front());
            queue_.pop_front();
            is_checking_ = true;
        }
        Result<void> checked;
        try {
            checked = checker_.check(waiting.answer, waiting.payload);
        } catch (const std::exception& error) {  // a job: no memory, most likely
            checked = fail(ErrorCode::internal, std::string("checking failed: ") + error.what());
        }
        {
            const MutexLock lock(mutex_);
            is_checking_ = false;
            ++counts_.checked;
            if (!checked) {
                ++counts_.wrong;
                if (counts_.first_wrong.empty()) {
                    counts_.first_wrong = checked.error().message;
                }
            }
        }
        changed_.notify_all();
    }
}

}  // namespace terrane
