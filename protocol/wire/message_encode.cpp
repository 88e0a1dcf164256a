// Plain values to FlatBuffers: the sending half of messages.h, and the proof that its tables are
// the schema's.
#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/coords.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/wire/frame.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <terrane_generated.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace terrane {

namespace {

using flatbuffers::FlatBufferBuilder;
using flatbuffers::Offset;

constexpr bool same(ErrorCode ours, wire::FailureCode theirs) {
    return static_cast<std::uint16_t>(ours) == static_cast<std::uint16_t>(theirs);
}

static_assert(same(ErrorCode::malformed, wire::FailureCode::Malformed));
static_assert(same(ErrorCode::too_large, wire::FailureCode::TooLarge));
static_assert(same(ErrorCode::unsupported, wire::FailureCode::Unsupported));
static_assert(same(ErrorCode::out_of_range, wire::FailureCode::OutOfRange));
static_assert(same(ErrorCode::invalid_argument, wire::FailureCode::InvalidArgument));
static_assert(same(ErrorCode::busy, wire::FailureCode::Busy));
static_assert(same(ErrorCode::cancelled, wire::FailureCode::Cancelled));
static_assert(same(ErrorCode::not_found, wire::FailureCode::NotFound));
static_assert(same(ErrorCode::wrong_world, wire::FailureCode::WrongWorld));
static_assert(same(ErrorCode::version_mismatch, wire::FailureCode::VersionMismatch));
static_assert(same(ErrorCode::io_error, wire::FailureCode::IoError));
static_assert(same(ErrorCode::corrupt, wire::FailureCode::Corrupt));
static_assert(same(ErrorCode::draining, wire::FailureCode::Draining));
static_assert(same(ErrorCode::unauthorized, wire::FailureCode::Unauthorized));
static_assert(same(ErrorCode::internal, wire::FailureCode::Internal));
static_assert(same(ErrorCode::internal, wire::FailureCode::MAX));

static_assert(static_cast<int>(ChunkFormat::draco) == static_cast<int>(wire::Format::Draco));
static_assert(static_cast<int>(ChunkFormat::columns) == static_cast<int>(wire::Format::Columns));
static_assert(static_cast<int>(ChunkFormat::draco_blocky) ==
              static_cast<int>(wire::Format::DracoBlocky));
static_assert(static_cast<int>(ChunkFormat::glb) == static_cast<int>(wire::Format::Glb));
static_assert(static_cast<int>(ChunkStatus::full) == static_cast<int>(wire::ChunkStatus::Full));
static_assert(static_cast<int>(ChunkStatus::empty) == static_cast<int>(wire::ChunkStatus::Empty));
static_assert(static_cast<int>(ChunkStatus::uniform) ==
              static_cast<int>(wire::ChunkStatus::Uniform));
static_assert(static_cast<int>(ChunkStatus::not_modified) ==
              static_cast<int>(wire::ChunkStatus::NotModified));
static_assert(static_cast<int>(ChunkSource::generated) ==
              static_cast<int>(wire::Source::Generated));
static_assert(static_cast<int>(ChunkSource::store) == static_cast<int>(wire::Source::Store));
static_assert(static_cast<int>(ChunkSource::cache) == static_cast<int>(wire::Source::Cache));

wire::Format wire_of(ChunkFormat format) {
    return static_cast<wire::Format>(format);
}

wire::Hash wire_of(Hash128 hash) {
    return {hash.high, hash.low};
}

wire::ChunkKey wire_of(ChunkPos key) {
    return {key.lod, key.x, key.y, key.z};
}

/// At most `bytes_max`, never cut inside a UTF-8 character.
Offset<flatbuffers::String> text_of(FlatBufferBuilder& builder, std::string_view text,
                                    std::size_t bytes_max) {
    if (text.size() > bytes_max) {
        std::size_t end = bytes_max;
        while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) {
            --end;
        }
        text = text.substr(0, end);
    }
    return builder.CreateString(text.data(), text.size());
}

Offset<wire::Composition> composition_of(FlatBufferBuilder& builder,
                                         const WireComposition& composition) {
    TERRANE_ASSERT(composition.size() <= kWireSharesMax);
    std::vector<Offset<wire::Share>> shares;
    shares.reserve(composition.size());
    for (const WireShare& share : composition) {
        shares.push_back(wire::CreateShare(builder, share.material, share.concentration));
    }
    return wire::CreateComposition(builder, builder.CreateVector(shares));
}

template <typename T>
T target_of(Offset<T>);  // never defined: names the table behind an offset

template <typename T>
using OffsetTarget = decltype(target_of(std::declval<T>()));

Offset<wire::ClientHello> write(FlatBufferBuilder& builder, const ClientHello& hello) {
    const auto name = text_of(builder, hello.client_name, kWireNameBytesMax);
    const auto token = text_of(builder, hello.token, kTokenBytesMax);
    return wire::CreateClientHello(builder, hello.protocol_version, name, token);
}

Offset<wire::ServerHello> write(FlatBufferBuilder& builder, const ServerHello& hello) {
    TERRANE_ASSERT(hello.materials.size() <= kWireMaterialsMax);
    std::vector<Offset<wire::Material>> materials;
    for (const WireMaterial& material : hello.materials) {
        const auto name = text_of(builder, material.name, kWireNameBytesMax);
        const auto texture = text_of(builder, material.texture, kWireNameBytesMax);
        materials.push_back(wire::CreateMaterial(builder, name, material.color_rgb, texture,
                                                 material.solid,
                                                 static_cast<wire::MaterialKind>(material.kind)));
    }
    const auto materials_at = builder.CreateVector(materials);
    const WireLimits& limits = hello.limits;
    const auto limits_at = wire::CreateLimits(
        builder, limits.keys_per_request_max, limits.keys_in_flight_max,
        limits.inbound_frame_bytes_max, limits.payload_bytes_max, limits.view_radius_max,
        limits.credit_window_bytes, limits.requests_per_second_max, limits.bytes_per_second_max);
    const auto server_version = text_of(builder, hello.server_version, kWireNameBytesMax);
    const auto world_name = text_of(builder, hello.world_name, kWireNameBytesMax);
    const wire::Hash fingerprint = wire_of(hello.fingerprint);
    const wire::Hash content_id = wire_of(hello.content_id);
    return wire::CreateServerHello(builder, hello.protocol_version, server_version,
                                   hello.generator_version, hello.encoding_version, world_name,
                                   &fingerprint, &content_id, hello.chunk_side, hello.chunk_height,
                                   hello.voxel_size_m, hello.levels, hello.height_bound_voxels,
                                   materials_at, limits_at, hello.mesh_parts);
}

Offset<wire::ChunkRequest> write(FlatBufferBuilder& builder, const ChunkRequest& request) {
    // More keys than a server takes may be written: tests send them.
    std::vector<wire::ChunkKey> keys;
    std::ranges::transform(request.keys, std::back_inserter(keys),
                           [](ChunkPos key) { return wire_of(key); });
    std::vector<wire::Hash> etags;
    std::ranges::transform(request.known_etags, std::back_inserter(etags),
                           [](Hash128 etag) { return wire_of(etag); });
    const auto keys_at = builder.CreateVectorOfStructs(keys);
    const auto etags_at = etags.empty() ? 0 : builder.CreateVectorOfStructs(etags);
    return wire::CreateChunkRequest(builder, request.request_id, wire_of(request.format), keys_at,
                                    etags_at, request.priority, request.without_flow);
}

Offset<wire::ChunkCancel> write(FlatBufferBuilder& builder, const ChunkCancel& cancel) {
    TERRANE_ASSERT(cancel.request_ids.size() <= kRequestsPerCancelMax);
    return wire::CreateChunkCancel(builder, builder.CreateVector(cancel.request_ids));
}

Offset<wire::Chunk> write(FlatBufferBuilder& builder, const ChunkAnswer& answer) {
    const Offset<wire::Composition> uniform =
        answer.uniform.empty() ? 0 : composition_of(builder, answer.uniform);
    const wire::ChunkKey key = wire_of(answer.key);
    const wire::Hash etag = wire_of(answer.etag);
    const wire::Timings timings(answer.timings.queue_us, answer.timings.generate_us,
                                answer.timings.mesh_us, answer.timings.encode_us);
    return wire::CreateChunk(builder, answer.request_id, &key, wire_of(answer.format),
                             static_cast<wire::ChunkStatus>(answer.status),
                             static_cast<wire::Source>(answer.source), &etag, &timings,
                             answer.payload_bytes, uniform);
}

Offset<wire::ColumnQuery> write(FlatBufferBuilder& builder, const ColumnQuery& query) {
    return wire::CreateColumnQuery(builder, query.request_id, query.column.x, query.column.z);
}

Offset<wire::Column> write(FlatBufferBuilder& builder, const ColumnAnswer& answer) {
    TERRANE_ASSERT(answer.limits.size() <= kWireLimitsMax);
    std::vector<Offset<wire::Limit>> limits;
    limits.reserve(answer.limits.size());
    for (const WireLimit& limit : answer.limits) {
        const auto composition = composition_of(builder, limit.composition);
        const wire::Flow flow(limit.flow_x, limit.flow_y, limit.flow_z);
        limits.push_back(wire::CreateLimit(builder, limit.y256, &flow, composition));
    }
    return wire::CreateColumn(builder, answer.request_id, answer.column.x, answer.column.z,
                              builder.CreateVector(limits));
}

Offset<wire::WorldQuery> write(FlatBufferBuilder& builder, const WorldQuery& query) {
    return wire::CreateWorldQuery(builder, query.request_id);
}

Offset<wire::WorldDefinition> write(FlatBufferBuilder& builder, const WorldAnswer& answer) {
    TERRANE_ASSERT(answer.toml.size() <= kWorldTextBytesMax);  // cut, it would be another world
    const auto toml = builder.CreateString(answer.toml);
    const wire::Hash fingerprint = wire_of(answer.fingerprint);
    return wire::CreateWorldDefinition(builder, answer.request_id, toml, &fingerprint);
}

Offset<wire::Failure> write(FlatBufferBuilder& builder, const Failure& failure) {
    const auto message = text_of(builder, failure.error.message, kTextBytesMax);
    const wire::ChunkKey key = wire_of(failure.key.value_or(ChunkPos{}));
    return wire::CreateFailure(builder, failure.request_id,
                               static_cast<wire::FailureCode>(failure.error.code), message,
                               failure.retry_after_ms, failure.key ? &key : nullptr);
}

Offset<wire::Ping> write(FlatBufferBuilder& builder, const Ping& ping) {
    return wire::CreatePing(builder, ping.nonce);
}

Offset<wire::Pong> write(FlatBufferBuilder& builder, const Pong& pong) {
    return wire::CreatePong(builder, pong.nonce);
}

Offset<wire::Goodbye> write(FlatBufferBuilder& builder, const Goodbye& goodbye) {
    const auto reason = text_of(builder, goodbye.reason, kTextBytesMax);
    const auto code =
        goodbye.code ? static_cast<wire::FailureCode>(*goodbye.code) : wire::FailureCode::None;
    return wire::CreateGoodbye(builder, code, reason);
}

wire::Vector wire_of(WireVector vector) {
    return {vector.x, vector.y, vector.z};
}

Offset<wire::ViewUpdate> write(FlatBufferBuilder& builder, const ViewUpdate& view) {
    // More levels than a server takes may be written: tests send them.
    const wire::Vector direction = wire_of(view.direction);
    const wire::Vector velocity = wire_of(view.velocity);
    const auto radius = view.radius_chunks.empty() ? 0 : builder.CreateVector(view.radius_chunks);
    return wire::CreateViewUpdate(builder, view.x, view.y, view.z, &direction, view.field_of_view,
                                  &velocity, radius, wire_of(view.format), view.without_flow,
                                  view.bytes_per_second_max);
}

Offset<wire::ChunkForget> write(FlatBufferBuilder& builder, const ChunkForget& forget) {
    TERRANE_ASSERT(forget.keys.size() <= kKeysPerForgetMax);
    std::vector<wire::ChunkKey> keys;
    std::ranges::transform(forget.keys, std::back_inserter(keys),
                           [](ChunkPos key) { return wire_of(key); });
    return wire::CreateChunkForget(builder, builder.CreateVectorOfStructs(keys));
}

Offset<wire::Credit> write(FlatBufferBuilder& builder, const Credit& credit) {
    return wire::CreateCredit(builder, credit.bytes);
}

}  // namespace

Bytes encode_message(const AnyMessage& message) {
    FlatBufferBuilder builder(256);
    const auto body = std::visit(
        [&builder]<typename T>(const T& value) {
            const auto written = write(builder, value);
            using Table = OffsetTarget<std::remove_const_t<decltype(written)>>;
            constexpr wire::Body kKind = wire::BodyTraits<Table>::enum_value;
            return std::pair(kKind, written.Union());
        },
        message);
    wire::FinishSizePrefixedMessageBuffer(builder,
                                          wire::CreateMessage(builder, body.first, body.second));
    const auto* answer = std::get_if<ChunkAnswer>(&message);
    return frame_head(std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize())),
                      answer != nullptr ? answer->payload_bytes : 0);
}

}  // namespace terrane
