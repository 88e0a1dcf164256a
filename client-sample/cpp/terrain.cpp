#include "client-sample/cpp/terrain.h"

#include "client-sample/cpp/chunk_reader.h"
#include "client-sample/cpp/client.h"
#include "client-sample/cpp/column_map.h"
#include "client-sample/cpp/connection.h"
#include "client-sample/cpp/view_set.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

namespace terrane {

namespace {

using std::chrono::steady_clock;

/// A mesh depends on chunks so many below, at most: two where chunks are 4 voxels high.
constexpr std::int32_t kHeightsBelowMax = 2;

}  // namespace

Terrain::Terrain(Client client, const TerrainOptions& options)
    : client_(std::move(client)),
      form_(options.form),
      radius_chunks_(options.radius_chunks),
      columns_(client_.hello()) {}

Result<Terrain> Terrain::connect(const TerrainOptions& options) {
    auto client = Client::connect(options.client);
    if (!client) {
        return tl::unexpected(client.error());
    }
    if (client->hello().limits.view_radius_max == 0) {
        return fail(ErrorCode::unsupported, "this server gives no views");
    }
    return Terrain(std::move(*client), options);
}

ChunkFormat Terrain::format() const {
    return form_ == TerrainForm::columns  ? ChunkFormat::columns
           : form_ == TerrainForm::blocky ? ChunkFormat::draco_blocky
                                          : ChunkFormat::draco;
}

Terrain::Placement Terrain::placement_of(ChunkPos key) const {
    const double voxel_m = world().voxel_size_m;
    const double column_m = voxel_m * std::exp2(key.lod);
    return {.x_m = key.x * column_m * world().chunk_side,
            .y_m = key.y * voxel_m * world().chunk_height,
            .z_m = key.z * column_m * world().chunk_side,
            .across_m = column_m / 256,
            .upwards_m = voxel_m / 256};
}

Result<void> Terrain::look(const Viewer& viewer) {
    const ViewUpdate update{.x = viewer.x,
                            .y = viewer.y,
                            .z = viewer.z,
                            .direction = viewer.direction,
                            .field_of_view = viewer.field_of_view,
                            .velocity = viewer.velocity,
                            .radius_chunks = radius_chunks_,
                            .format = format(),
                            // Meshes need none, and it is two thirds of the bytes.
                            .without_flow = form_ == TerrainForm::columns,
                            .bytes_per_second_max = 0};
    if (const auto told = client_.view(update); !told) {
        return told;
    }
    has_looked_ = true;
    const ViewSet next(update, world());
    if (next == view_) {
        return {};
    }
    view_ = next;
    missing_ = 0;
    for (const StackPos square : view_.squares()) {
        missing_ += static_cast<std::size_t>(heights_of(square.lod, world()));
    }
    missing_ -= static_cast<std::size_t>(
        std::ranges::count_if(come_, [this](ChunkPos key) { return is_wanted(key); }));
    // Some wait for neighbours that are not wanted any more.
    to_look_at_.clear();
    for (const auto& [key, meshed] : meshed_) {
        if (meshed == Meshed::no) {
            to_look_at_.push_back(key);
        }
    }
    return {};
}

Result<std::vector<TerrainChange>> Terrain::poll(Deadline deadline) {
    std::vector<TerrainChange> changes;
    while (changes.size() < kChangesPerPollMax) {
        if (!to_look_at_.empty()) {
            const ChunkPos key = to_look_at_.back();
            to_look_at_.pop_back();
            mesh_if_ready(key, changes);
        } else {
            auto next = client_.next(changes.empty() ? deadline : steady_clock::now());
            if (!next) {
                return tl::unexpected(next.error());
            }
            std::optional<ClientEvent>& event = *next;
            if (!event) {
                break;
            }
            if (const auto taken = take(*std::move(event), changes); !taken) {
                return tl::unexpected(taken.error());
            }
        }
        if (steady_clock::now() >= deadline) {
            break;
        }
    }
    return changes;
}

Result<void> Terrain::take(ClientEvent event, std::vector<TerrainChange>& changes) {
    if (const auto* chunk = std::get_if<ReceivedChunk>(&event)) {
        take_chunk(*chunk, changes);
    } else if (const auto* forget = std::get_if<ChunkForget>(&event)) {
        take_forget(*forget, changes);
    } else if (const auto* failure = std::get_if<Failure>(&event)) {
        const bool is_final = failure->error.code != ErrorCode::busy;
        if (failure->key && is_final && is_wanted(*failure->key) &&
            come_.insert(*failure->key).second) {
            --missing_;  // it will not come
        }
        changes.emplace_back(*failure);
    } else if (const auto* goodbye = std::get_if<Goodbye>(&event)) {
        return fail(goodbye->code.value_or(ErrorCode::draining),
                    "the server says goodbye: " + goodbye->reason);
    }
    return {};
}

void Terrain::take_chunk(const ReceivedChunk& chunk, std::vector<TerrainChange>& changes) {
    const ChunkPos key = chunk.answer.key;
    received_bytes_ += chunk.payload.size();
    if (come_.insert(key).second && is_wanted(key)) {
        --missing_;
    }
    const auto unreadable = [&](const Error& error) {
        changes.emplace_back(
            Failure{.request_id = 0, .error = error, .retry_after_ms = 0, .key = key});
    };
    if (form_ == TerrainForm::columns) {
        if (const auto put = columns_.put(chunk.answer, chunk.payload); !put) {
            unreadable(put.error());
            return;
        }
        meshed_[key] = Meshed::no;
        mesh_around(key, changes);
        return;
    }
    auto content = read_chunk(chunk.answer, chunk.payload, world());
    if (!content) {
        unreadable(content.error());
        return;
    }
    changes.emplace_back(ChunkReady{.key = key, .mesh = std::move(content->mesh).value_or(Mesh())});
}

void Terrain::take_forget(const ChunkForget& forget, std::vector<TerrainChange>& changes) {
    for (const ChunkPos key : forget.keys) {
        if (come_.erase(key) > 0) {
            missing_ += is_wanted(key) ? 1U : 0U;  // it will come again
            columns_.forget(key);
            meshed_.erase(key);
            changes.emplace_back(ChunkGone{.key = key});
        }
    }
}

void Terrain::mesh_if_ready(ChunkPos key, std::vector<TerrainChange>& changes) {
    const auto state = meshed_.find(key);
    if (state == meshed_.end() || state->second == Meshed::exactly) {
        return;
    }
    const auto missing = columns_.missing_for_mesh(key);
    const bool is_at_the_rim = !missing.empty();
    if (is_at_the_rim &&
        (state->second == Meshed::at_the_rim ||
         std::ranges::any_of(missing, [this](ChunkPos needed) { return is_wanted(needed); }))) {
        return;
    }
    auto mesh =
        columns_.mesh(key, is_at_the_rim ? MissingNeighbour::repeat : MissingNeighbour::refuse);
    state->second = is_at_the_rim ? Meshed::at_the_rim : Meshed::exactly;
    if (mesh) {
        changes.emplace_back(ChunkReady{.key = key, .mesh = std::move(*mesh)});
    } else {
        changes.emplace_back(
            Failure{.request_id = 0, .error = mesh.error(), .retry_after_ms = 0, .key = key});
    }
}

/// A chunk that has come may be what its neighbours waited for.
void Terrain::mesh_around(ChunkPos key, std::vector<TerrainChange>& changes) {
    const std::int32_t above = key.lod > 0 ? 0 : kHeightsBelowMax;
    const std::int32_t below =
        key.lod == 0 && world().mesh_parts ? std::clamp(key.y, 0, heights_of(0, world())) : above;
    for (std::int32_t z = -1; z <= 1; ++z) {
        for (std::int32_t x = -1; x <= 1; ++x) {
            for (std::int32_t y = -below; y <= above; ++y) {
                mesh_if_ready({.lod = key.lod, .x = key.x + x, .y = key.y + y, .z = key.z + z},
                              changes);
            }
        }
    }
}

}  // namespace terrane
