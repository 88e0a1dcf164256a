// One message of every kind with every field set, for the wire tests.
#pragma once

#include "protocol/wire/messages.h"

#include <vector>

namespace terrane {

inline std::vector<AnyMessage> sample_messages() {
    const WireComposition granite = {{.material = 3, .concentration = 0.75},
                                     {.material = 1, .concentration = 0.25}};
    const ChunkPos key{.lod = 0, .x = -1, .y = 2, .z = 2147483647};
    return {
        ClientHello{.protocol_version = 1, .client_name = "test", .token = "secret"},
        ServerHello{
            .protocol_version = 1,
            .server_version = "0.1.0",
            .generator_version = 1,
            .encoding_version = 2,
            .world_name = "paper",
            .fingerprint = {.high = 1, .low = 2},
            .content_id = {.high = 3, .low = 4},
            .chunk_side = 32,
            .chunk_height = 16,
            .voxel_size_m = 0.5,
            .levels = 1,
            .height_bound_voxels = 99.5,
            .materials =
                {{.name = "granite", .color_rgb = 0x808182, .texture = "g.png", .solid = true},
                 {.name = "air",
                  .color_rgb = 0,
                  .texture = {},
                  .solid = false,
                  .kind = WireMaterialKind::void_},
                 {.name = "sea",
                  .color_rgb = 1,
                  .texture = {},
                  .solid = false,
                  .kind = WireMaterialKind::water}},
            .limits = {.keys_per_request_max = 64,
                       .keys_in_flight_max = 1024,
                       .inbound_frame_bytes_max = 65536,
                       .payload_bytes_max = 1U << 26U,
                       .view_radius_max = 64,
                       .credit_window_bytes = 262144,
                       .requests_per_second_max = 500,
                       .bytes_per_second_max = 8000},
            .mesh_parts = true},
        ChunkRequest{.request_id = 7,
                     .format = ChunkFormat::columns,
                     .keys = {key, {.lod = 1, .x = -2147483647 - 1, .y = 0, .z = 5}},
                     .known_etags = {{.high = 9, .low = 8}, {}},
                     .priority = -4,
                     .without_flow = true},
        ChunkCancel{.request_ids = {7, 9}},
        ChunkAnswer{.request_id = 7,
                    .key = key,
                    .format = ChunkFormat::columns,
                    .status = ChunkStatus::uniform,
                    .source = ChunkSource::cache,
                    .etag = {.high = 5, .low = 6},
                    .timings = {.queue_us = 1, .generate_us = 2, .mesh_us = 3, .encode_us = 4},
                    .payload_bytes = 0,
                    .uniform = granite},
        ColumnQuery{.request_id = 8, .column = {.x = -5, .z = kColumnCoordinateLimit - 1}},
        ColumnAnswer{
            .request_id = 8,
            .column = {.x = -5, .z = 6},
            .limits =
                {{.y256 = -256, .flow_x = 127, .flow_y = -128, .flow_z = 1, .composition = granite},
                 {.y256 = 2377, .flow_x = 0, .flow_y = 0, .flow_z = 0, .composition = {}}}},
        WorldQuery{.request_id = 10},
        WorldAnswer{.request_id = 10, .toml = "seed = 1\n", .fingerprint = {.high = 1, .low = 2}},
        Failure{.request_id = 7,
                .error = {.code = ErrorCode::busy, .message = "queue is full at 4096 jobs"},
                .retry_after_ms = 50,
                .key = key},
        Failure{.request_id = 0,
                .error = {.code = ErrorCode::malformed, .message = "frame"},
                .retry_after_ms = 0,
                .key = std::nullopt},
        Ping{.nonce = 0x0123456789abcdef},
        Pong{.nonce = 1},
        Goodbye{.code = ErrorCode::draining, .reason = "restart"},
        Goodbye{.code = std::nullopt, .reason = {}},
        ViewUpdate{.x = -1234.5,
                   .y = 67.25,
                   .z = 9e15,
                   .direction = {.x = 0.5F, .y = -0.25F, .z = 0.75F},
                   .field_of_view = 1.5F,
                   .velocity = {.x = -50, .y = 0, .z = 0.5F},
                   .radius_chunks = {16, 12, 0, 4294967295U},
                   .format = ChunkFormat::columns,
                   .without_flow = true,
                   .bytes_per_second_max = 8000},
        ViewUpdate{},
        ChunkForget{.keys = {key, {.lod = 9, .x = 1, .y = 0, .z = -4}}},
        Credit{.bytes = std::uint64_t{1} << 40U},
    };
}

}  // namespace terrane
