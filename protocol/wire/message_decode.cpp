// FlatBuffers to plain values: the receiving half of messages.h. Everything a peer may get wrong
// inside a well-formed FlatBuffer is caught here.
#include "protocol/base/coords.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/wire/frame.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <terrane_generated.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace terrane {

namespace {

template <typename... Parts>
tl::unexpected<Error> bad(ErrorCode code, const Parts&... parts) {
    std::string message;
    (message.append(parts), ...);
    return fail(code, std::move(message));
}

Hash128 hash_of(const wire::Hash* hash) {
    return hash == nullptr ? Hash128{} : Hash128{.high = hash->high(), .low = hash->low()};
}

ChunkPos key_of(const wire::ChunkKey& key) {
    return {.lod = key.lod(), .x = key.x(), .y = key.y(), .z = key.z()};
}

/// A missing string is an empty one. `what` names the field in the error.
Result<std::string> text_of(const flatbuffers::String* text, std::size_t bytes_max,
                            std::string_view what) {
    if (text == nullptr) {
        return std::string();
    }
    if (text->size() > bytes_max) {
        return bad(ErrorCode::malformed, what, ": ", std::to_string(text->size()),
                   " bytes, at most ", std::to_string(bytes_max), " are accepted");
    }
    return text->str();
}

template <typename T>
std::size_t size_of(const flatbuffers::Vector<T>* vector) {
    return vector == nullptr ? 0 : vector->size();
}

Result<void> check_request_id(std::uint32_t request_id, std::string_view what) {
    if (request_id == 0) {
        return bad(ErrorCode::invalid_argument, what,
                   ": request id 0 means the session, use another");
    }
    return {};
}

Result<ChunkFormat> format_of(wire::Format format) {
    if (format > wire::Format::Glb) {
        return bad(ErrorCode::unsupported, "format ", std::to_string(static_cast<int>(format)),
                   " is not known; 0 is draco, 1 is columns, 2 is blocky, 3 is glb");
    }
    return static_cast<ChunkFormat>(format);
}

Result<WireComposition> composition_of(const wire::Composition* composition) {
    WireComposition shares;
    if (composition == nullptr || composition->shares() == nullptr) {
        return shares;
    }
    if (composition->shares()->size() > kWireSharesMax) {
        return bad(ErrorCode::malformed,
                   "composition: ", std::to_string(composition->shares()->size()),
                   " shares, at most ", std::to_string(kWireSharesMax));
    }
    for (const wire::Share* share : *composition->shares()) {
        if (!(share->concentration() >= 0 && share->concentration() <= 1)) {
            return bad(ErrorCode::malformed, "composition: a concentration outside 0..1");
        }
        shares.push_back({.material = share->material(), .concentration = share->concentration()});
    }
    return shares;
}

Result<AnyMessage> read(const wire::ClientHello& table) {
    auto name = text_of(table.client_name(), kWireNameBytesMax, "ClientHello.client_name");
    auto token = text_of(table.token(), kTokenBytesMax, "ClientHello.token");
    if (!name || !token) {
        return tl::unexpected(!name ? name.error() : token.error());
    }
    if (std::ranges::any_of(
            *name, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; })) {
        return bad(ErrorCode::malformed, "ClientHello.client_name: control characters");
    }
    return ClientHello{.protocol_version = table.protocol_version(),
                       .client_name = std::move(*name),
                       .token = std::move(*token)};
}

WireMaterialKind kind_of(const wire::Material& table) {
    if (table.kind() > wire::MaterialKind::MAX) {
        return table.solid() ? WireMaterialKind::regular : WireMaterialKind::void_;
    }
    return static_cast<WireMaterialKind>(table.kind());
}

Result<WireMaterial> material_of(const wire::Material& table) {
    auto name = text_of(table.name(), kWireNameBytesMax, "ServerHello.materials.name");
    auto texture = text_of(table.texture(), kWireNameBytesMax, "ServerHello.materials.texture");
    if (!name || !texture) {
        return tl::unexpected(!name ? name.error() : texture.error());
    }
    return WireMaterial{.name = std::move(*name),
                        .color_rgb = table.color_rgb() & 0xFFFFFFU,
                        .texture = std::move(*texture),
                        .solid = table.solid(),
                        .kind = kind_of(table)};
}

Result<void> check_geometry(const wire::ServerHello& table) {
    const auto side_is_valid = [](std::int32_t side) { return side >= 1 && side <= kWireSideMax; };
    if (!side_is_valid(table.chunk_side()) || !side_is_valid(table.chunk_height())) {
        return bad(ErrorCode::malformed, "ServerHello: a chunk of ",
                   std::to_string(table.chunk_side()), " x ", std::to_string(table.chunk_height()),
                   " voxels, sides are 1..", std::to_string(kWireSideMax));
    }
    if (!(table.voxel_size_m() >= kWireVoxelSizeMinM &&
          table.voxel_size_m() <= kWireVoxelSizeMaxM) ||
        !std::isfinite(table.height_bound_voxels())) {
        return bad(ErrorCode::malformed,
                   "ServerHello: voxel size or height bound is not a usable number");
    }
    if (table.levels() < 1 || table.levels() > kLodMax + 1) {
        return bad(ErrorCode::malformed, "ServerHello: ", std::to_string(table.levels()),
                   " levels, 1..", std::to_string(kLodMax + 1), " are possible");
    }
    if (table.limits() == nullptr || table.limits()->keys_per_request_max() == 0 ||
        table.limits()->keys_in_flight_max() == 0) {
        return bad(ErrorCode::malformed, "ServerHello: its limits allow no request");
    }
    return {};
}

Result<AnyMessage> read(const wire::ServerHello& table) {
    if (const auto checked = check_geometry(table); !checked) {
        return tl::unexpected(checked.error());
    }
    auto server_version =
        text_of(table.server_version(), kWireNameBytesMax, "ServerHello.server_version");
    auto world_name = text_of(table.world_name(), kWireNameBytesMax, "ServerHello.world_name");
    if (!server_version || !world_name) {
        return tl::unexpected(!server_version ? server_version.error() : world_name.error());
    }
    if (size_of(table.materials()) > kWireMaterialsMax) {
        return bad(ErrorCode::malformed,
                   "ServerHello.materials: ", std::to_string(table.materials()->size()),
                   " entries, at most ", std::to_string(kWireMaterialsMax));
    }
    ServerHello hello{
        .protocol_version = table.protocol_version(),
        .server_version = std::move(*server_version),
        .generator_version = table.generator_version(),
        .encoding_version = table.encoding_version(),
        .world_name = std::move(*world_name),
        .fingerprint = hash_of(table.fingerprint()),
        .content_id = hash_of(table.content_id()),
        .chunk_side = table.chunk_side(),
        .chunk_height = table.chunk_height(),
        .voxel_size_m = table.voxel_size_m(),
        .levels = table.levels(),
        .height_bound_voxels = table.height_bound_voxels(),
        .materials = {},
        .limits = {.keys_per_request_max = table.limits()->keys_per_request_max(),
                   .keys_in_flight_max = table.limits()->keys_in_flight_max(),
                   .inbound_frame_bytes_max = table.limits()->inbound_frame_bytes_max(),
                   .payload_bytes_max = table.limits()->payload_bytes_max(),
                   .view_radius_max = table.limits()->view_radius_max(),
                   .credit_window_bytes = table.limits()->credit_window_bytes(),
                   .requests_per_second_max = table.limits()->requests_per_second_max(),
                   .bytes_per_second_max = table.limits()->bytes_per_second_max()},
        .mesh_parts = table.mesh_parts()};
    for (std::size_t i = 0; i < size_of(table.materials()); ++i) {
        auto material =
            material_of(*table.materials()->Get(static_cast<flatbuffers::uoffset_t>(i)));
        if (!material) {
            return tl::unexpected(material.error());
        }
        hello.materials.push_back(std::move(*material));
    }
    return hello;
}

Result<AnyMessage> read(const wire::ChunkRequest& table) {
    if (const auto checked = check_request_id(table.request_id(), "ChunkRequest"); !checked) {
        return tl::unexpected(checked.error());
    }
    const auto format = format_of(table.format());
    if (!format) {
        return bad(format.error().code, "ChunkRequest: ", format.error().message);
    }
    const std::size_t key_count = size_of(table.keys());
    if (key_count == 0 || key_count > kKeysPerRequestMax) {
        return bad(ErrorCode::invalid_argument, "ChunkRequest: ", std::to_string(key_count),
                   " keys, 1..", std::to_string(kKeysPerRequestMax), " are accepted");
    }
    const std::size_t etag_count = size_of(table.known_etags());
    if (etag_count != 0 && etag_count != key_count) {
        return bad(ErrorCode::invalid_argument, "ChunkRequest: ", std::to_string(etag_count),
                   " etags for ", std::to_string(key_count), " keys; give none or one a key");
    }
    ChunkRequest request{.request_id = table.request_id(),
                         .format = *format,
                         .keys = {},
                         .known_etags = std::vector<Hash128>(etag_count),
                         .priority = table.priority(),
                         .without_flow = table.without_flow()};
    request.keys.reserve(key_count);
    for (const wire::ChunkKey* key : *table.keys()) {
        request.keys.push_back(key_of(*key));
    }
    for (std::size_t i = 0; i < etag_count; ++i) {
        // The Verifier checks a vector's length for alignment, not its elements: copied, never
        // pointed at.
        std::uint64_t halves[2];
        static_assert(sizeof(halves) == sizeof(wire::Hash));
        std::memcpy(halves, table.known_etags()->Data() + i * sizeof(halves), sizeof(halves));
        request.known_etags[i] = {.high = halves[0], .low = halves[1]};
    }
    return request;
}

Result<AnyMessage> read(const wire::ChunkCancel& table) {
    const std::size_t count = size_of(table.request_ids());
    if (count == 0 || count > kRequestsPerCancelMax) {
        return bad(ErrorCode::invalid_argument, "ChunkCancel: ", std::to_string(count),
                   " request ids, 1..", std::to_string(kRequestsPerCancelMax), " are accepted");
    }
    return ChunkCancel{.request_ids = {table.request_ids()->begin(), table.request_ids()->end()}};
}

Result<AnyMessage> read(const wire::Chunk& table) {
    const auto format = format_of(table.format());
    if (!format || table.status() > wire::ChunkStatus::MAX || table.source() > wire::Source::MAX) {
        return bad(ErrorCode::malformed,
                   "Chunk: a format, status or source that was not asked for");
    }
    if (table.key() == nullptr) {
        return bad(ErrorCode::malformed, "Chunk: no key");
    }
    if ((table.status() == wire::ChunkStatus::Full) != (table.payload_bytes() > 0)) {
        return bad(ErrorCode::malformed, "Chunk: a full chunk has a payload and no other has");
    }
    auto uniform = composition_of(table.uniform());
    if (!uniform) {
        return tl::unexpected(uniform.error());
    }
    ChunkAnswer answer{.request_id = table.request_id(),
                       .key = key_of(*table.key()),
                       .format = *format,
                       .status = static_cast<ChunkStatus>(table.status()),
                       .source = static_cast<ChunkSource>(table.source()),
                       .etag = hash_of(table.etag()),
                       .timings = {},
                       .payload_bytes = table.payload_bytes(),
                       .uniform = std::move(*uniform)};
    if (const wire::Timings* timings = table.timings()) {
        answer.timings = {.queue_us = timings->queue_us(),
                          .generate_us = timings->generate_us(),
                          .mesh_us = timings->mesh_us(),
                          .encode_us = timings->encode_us()};
    }
    return answer;
}

Result<AnyMessage> read(const wire::ColumnQuery& table) {
    if (const auto checked = check_request_id(table.request_id(), "ColumnQuery"); !checked) {
        return tl::unexpected(checked.error());
    }
    const auto is_near = [](std::int64_t c) {
        return c > -kColumnCoordinateLimit && c < kColumnCoordinateLimit;
    };
    if (!is_near(table.x()) || !is_near(table.z())) {
        return bad(ErrorCode::out_of_range, "ColumnQuery: (", std::to_string(table.x()), ", ",
                   std::to_string(table.z()), ") is not within 2^53 of the origin");
    }
    return ColumnQuery{.request_id = table.request_id(),
                       .column = {.x = table.x(), .z = table.z()}};
}

Result<AnyMessage> read(const wire::Column& table) {
    if (size_of(table.limits()) > kWireLimitsMax) {
        return bad(ErrorCode::malformed, "Column: ", std::to_string(table.limits()->size()),
                   " limits, at most ", std::to_string(kWireLimitsMax));
    }
    ColumnAnswer answer{
        .request_id = table.request_id(), .column = {.x = table.x(), .z = table.z()}, .limits = {}};
    for (std::size_t i = 0; i < size_of(table.limits()); ++i) {
        const wire::Limit& limit = *table.limits()->Get(static_cast<flatbuffers::uoffset_t>(i));
        auto composition = composition_of(limit.composition());
        if (!composition) {
            return tl::unexpected(composition.error());
        }
        const wire::Flow flow = limit.flow() == nullptr ? wire::Flow() : *limit.flow();
        answer.limits.push_back({.y256 = limit.y256(),
                                 .flow_x = flow.x(),
                                 .flow_y = flow.y(),
                                 .flow_z = flow.z(),
                                 .composition = std::move(*composition)});
    }
    return answer;
}

Result<AnyMessage> read(const wire::WorldQuery& table) {
    if (const auto checked = check_request_id(table.request_id(), "WorldQuery"); !checked) {
        return tl::unexpected(checked.error());
    }
    return WorldQuery{.request_id = table.request_id()};
}

Result<AnyMessage> read(const wire::WorldDefinition& table) {
    return text_of(table.toml(), kWorldTextBytesMax, "WorldDefinition.toml")
        .map([&table](std::string toml) {
            return AnyMessage(WorldAnswer{.request_id = table.request_id(),
                                          .toml = std::move(toml),
                                          .fingerprint = hash_of(table.fingerprint())});
        });
}

/// A code that only a newer peer knows reads as `internal`: the message still tells a person.
ErrorCode code_of(wire::FailureCode code) {
    return code > wire::FailureCode::MAX ? ErrorCode::internal : static_cast<ErrorCode>(code);
}

Result<AnyMessage> read(const wire::Failure& table) {
    auto message = text_of(table.message(), kTextBytesMax, "Failure.message");
    if (!message) {
        return tl::unexpected(message.error());
    }
    if (table.code() == wire::FailureCode::None) {
        return bad(ErrorCode::malformed, "Failure: no code");
    }
    Failure failure{.request_id = table.request_id(),
                    .error = {.code = code_of(table.code()), .message = std::move(*message)},
                    .retry_after_ms = std::min(table.retry_after_ms(), kRetryAfterMaxMs),
                    .key = std::nullopt};
    if (table.key() != nullptr) {
        failure.key = key_of(*table.key());
    }
    return failure;
}

Result<AnyMessage> read(const wire::Ping& table) {
    return Ping{.nonce = table.nonce()};
}

Result<AnyMessage> read(const wire::Pong& table) {
    return Pong{.nonce = table.nonce()};
}

Result<AnyMessage> read(const wire::Goodbye& table) {
    auto reason = text_of(table.reason(), kTextBytesMax, "Goodbye.reason");
    if (!reason) {
        return tl::unexpected(reason.error());
    }
    Goodbye goodbye{.code = std::nullopt, .reason = std::move(*reason)};
    if (table.code() != wire::FailureCode::None) {
        goodbye.code = code_of(table.code());
    }
    return goodbye;
}

WireVector vector_of(const wire::Vector* vector) {
    return vector == nullptr ? WireVector{}
                             : WireVector{.x = vector->x(), .y = vector->y(), .z = vector->z()};
}

bool is_finite(WireVector vector) {
    return std::isfinite(vector.x) && std::isfinite(vector.y) && std::isfinite(vector.z);
}

Result<void> check_view(const ViewUpdate& view) {
    if (!std::isfinite(view.x) || !std::isfinite(view.y) || !std::isfinite(view.z) ||
        !is_finite(view.direction) || !is_finite(view.velocity)) {
        return bad(ErrorCode::invalid_argument,
                   "ViewUpdate: position, direction and velocity must be finite numbers");
    }
    for (const double at : {view.x, view.y, view.z}) {
        if (std::abs(at) >= static_cast<double>(kColumnCoordinateLimit)) {
            return bad(ErrorCode::out_of_range, "ViewUpdate: the viewer at (",
                       std::to_string(view.x), ", ", std::to_string(view.y), ", ",
                       std::to_string(view.z), ") is not within 2^53 of the origin");
        }
    }
    if (!(view.field_of_view >= 0 && view.field_of_view <= kFieldOfViewMax)) {
        return bad(ErrorCode::invalid_argument, "ViewUpdate: a field of view of ",
                   std::to_string(view.field_of_view), " radians, 0..2 pi are accepted");
    }
    return {};
}

Result<AnyMessage> read(const wire::ViewUpdate& table) {
    const auto format = format_of(table.format());
    if (!format) {
        return bad(format.error().code, "ViewUpdate: ", format.error().message);
    }
    if (size_of(table.radius_chunks()) > kViewLevelsMax) {
        return bad(ErrorCode::invalid_argument,
                   "ViewUpdate: ", std::to_string(table.radius_chunks()->size()),
                   " radii, one a level and at most ", std::to_string(kViewLevelsMax),
                   " are accepted");
    }
    ViewUpdate view{.x = table.x(),
                    .y = table.y(),
                    .z = table.z(),
                    .direction = vector_of(table.direction()),
                    .field_of_view = table.field_of_view(),
                    .velocity = vector_of(table.velocity()),
                    .radius_chunks = {},
                    .format = *format,
                    .without_flow = table.without_flow(),
                    .bytes_per_second_max = table.bytes_per_second_max()};
    if (table.radius_chunks() != nullptr) {
        view.radius_chunks.assign(table.radius_chunks()->begin(), table.radius_chunks()->end());
    }
    if (const auto checked = check_view(view); !checked) {
        return tl::unexpected(checked.error());
    }
    return view;
}

Result<AnyMessage> read(const wire::ChunkForget& table) {
    const std::size_t key_count = size_of(table.keys());
    if (key_count == 0 || key_count > kKeysPerForgetMax) {
        return bad(ErrorCode::malformed, "ChunkForget: ", std::to_string(key_count), " keys, 1..",
                   std::to_string(kKeysPerForgetMax), " are possible");
    }
    ChunkForget forget;
    forget.keys.reserve(key_count);
    for (const wire::ChunkKey* key : *table.keys()) {
        forget.keys.push_back(key_of(*key));
    }
    return forget;
}

Result<AnyMessage> read(const wire::Credit& table) {
    return Credit{.bytes = table.bytes()};
}

Result<AnyMessage> read_body(const wire::Message& head) {
    switch (head.body_type()) {
        case wire::Body::ClientHello:
            return read(*head.body_as_ClientHello());
        case wire::Body::ServerHello:
            return read(*head.body_as_ServerHello());
        case wire::Body::ChunkRequest:
            return read(*head.body_as_ChunkRequest());
        case wire::Body::ChunkCancel:
            return read(*head.body_as_ChunkCancel());
        case wire::Body::Chunk:
            return read(*head.body_as_Chunk());
        case wire::Body::ColumnQuery:
            return read(*head.body_as_ColumnQuery());
        case wire::Body::Column:
            return read(*head.body_as_Column());
        case wire::Body::WorldQuery:
            return read(*head.body_as_WorldQuery());
        case wire::Body::WorldDefinition:
            return read(*head.body_as_WorldDefinition());
        case wire::Body::Failure:
            return read(*head.body_as_Failure());
        case wire::Body::Ping:
            return read(*head.body_as_Ping());
        case wire::Body::Pong:
            return read(*head.body_as_Pong());
        case wire::Body::Goodbye:
            return read(*head.body_as_Goodbye());
        case wire::Body::ViewUpdate:
            return read(*head.body_as_ViewUpdate());
        case wire::Body::ChunkForget:
            return read(*head.body_as_ChunkForget());
        case wire::Body::Credit:
            return read(*head.body_as_Credit());
        case wire::Body::NONE:
            break;
    }
    return bad(ErrorCode::unsupported, "message of kind ",
               std::to_string(static_cast<int>(head.body_type())), " is not known");
}

}  // namespace

Result<AnyMessage> decode_message(const Frame& frame) {
    if (frame.head->body_type() == wire::Body::NONE || frame.head->body() == nullptr) {
        return bad(ErrorCode::malformed, "message: empty");
    }
    auto message = read_body(*frame.head);
    if (!message) {
        return message;
    }
    const auto* answer = std::get_if<ChunkAnswer>(&*message);
    const std::size_t payload_bytes = answer == nullptr ? 0 : answer->payload_bytes;
    if (payload_bytes != frame.payload.size()) {
        return bad(ErrorCode::malformed, name_of(*message), ": a payload of ",
                   std::to_string(frame.payload.size()), " bytes, its head says ",
                   std::to_string(payload_bytes));
    }
    return message;
}

bool is_known(const Frame& frame) {
    return frame.head->body_type() <= wire::Body::MAX;
}

std::uint32_t request_id_of(const Frame& frame) {
    const wire::Message& head = *frame.head;
    if (const auto* request = head.body_as_ChunkRequest()) {
        return request->request_id();
    }
    if (const auto* query = head.body_as_ColumnQuery()) {
        return query->request_id();
    }
    if (const auto* query = head.body_as_WorldQuery()) {
        return query->request_id();
    }
    return 0;
}

}  // namespace terrane
