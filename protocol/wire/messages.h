// The messages of the native protocol as plain values, and their way to and from FlatBuffers.
//
// Whoever sends or receives works with these structs only. Reading validates at the edge: what
// comes out has known enum values, finite numbers, counts and texts within limits.h. What a value
// *means* (does this level exist, is this version ours) is the receiver's to judge. All functions:
// any thread.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/wire/frame.h"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace terrane {

enum class ChunkFormat : std::uint8_t { draco = 0, columns = 1, draco_blocky = 2, glb = 3 };
enum class ChunkStatus : std::uint8_t { full = 0, empty = 1, uniform = 2, not_modified = 3 };
enum class ChunkSource : std::uint8_t { generated = 0, store = 1, cache = 2 };

/// As on the command line and in JSON, e.g. "draco", "blocky", "not_modified", "generated".
std::string_view to_string(ChunkFormat format);
std::string_view to_string(ChunkStatus status);
std::string_view to_string(ChunkSource source);

/// What the server spent on an answer, microseconds each.
struct AnswerTimings {
    std::uint32_t queue_us = 0;
    std::uint32_t generate_us = 0;
    std::uint32_t mesh_us = 0;
    std::uint32_t encode_us = 0;

    friend bool operator==(const AnswerTimings&, const AnswerTimings&) = default;
};

/// `material` is an index into ServerHello::materials, `concentration` in [0, 1].
struct WireShare {
    std::uint16_t material = 0;
    double concentration = 0;

    friend bool operator==(const WireShare&, const WireShare&) = default;
};

/// Main material first; empty where a message has no composition.
using WireComposition = std::vector<WireShare>;

/// As in a world file.
enum class WireMaterialKind : std::uint8_t {
    void_ = 0,
    base = 1,
    regular = 2,
    vein = 3,
    cave = 4,
    soil = 5,
    sand = 6,
    snow = 7,
    water = 8
};

struct WireMaterial {
    std::string name;
    std::uint32_t color_rgb = 0;  ///< 0xRRGGBB, sRGB
    std::string texture;          ///< file name, may be empty
    bool solid = true;            ///< one can stand on it
    /// A kind this build doesn't know is read as regular if it is solid, else as void.
    WireMaterialKind kind = WireMaterialKind::regular;

    friend bool operator==(const WireMaterial&, const WireMaterial&) = default;
};

/// What a server holds a session to.
struct WireLimits {
    std::uint32_t keys_per_request_max = 0;
    std::uint32_t keys_in_flight_max = 0;
    std::uint32_t inbound_frame_bytes_max = 0;
    std::uint32_t payload_bytes_max = 0;
    std::uint32_t view_radius_max = 0;          ///< of each level, in its chunk sides; 0: no views
    std::uint32_t credit_window_bytes = 0;      ///< of a view's chunks, sent and not credited
    std::uint32_t requests_per_second_max = 0;  ///< 0: no cap
    std::uint64_t bytes_per_second_max = 0;     ///< 0: no cap

    friend bool operator==(const WireLimits&, const WireLimits&) = default;
};

struct ClientHello {
    std::uint32_t protocol_version = 0;
    std::string client_name;  ///< no control characters: it goes to logs
    std::string token;

    friend bool operator==(const ClientHello&, const ClientHello&) = default;
};

struct ServerHello {
    std::uint32_t protocol_version = 0;
    std::string server_version;
    std::uint32_t generator_version = 0;
    std::uint32_t encoding_version = 0;
    std::string world_name;
    Hash128 fingerprint;
    Hash128 content_id;
    std::int32_t chunk_side = 0;    ///< columns, 1..64
    std::int32_t chunk_height = 0;  ///< voxels, 1..64
    double voxel_size_m = 0;        ///< > 0
    std::int32_t levels = 0;        ///< levels 0..levels-1 are served; >= 1
    double height_bound_voxels = 0;
    std::vector<WireMaterial> materials;
    WireLimits limits;
    bool mesh_parts = false;  ///< meshes are of ground, caves and water: a landscape

    friend bool operator==(const ServerHello&, const ServerHello&) = default;
};

struct ChunkRequest {
    std::uint32_t request_id = 0;  ///< not 0
    ChunkFormat format = ChunkFormat::draco;
    std::vector<ChunkPos> keys;        ///< 1..kKeysPerRequestMax
    std::vector<Hash128> known_etags;  ///< empty, or one a key; all zero means none
    std::int32_t priority = 0;         ///< higher first
    bool without_flow = false;

    friend bool operator==(const ChunkRequest&, const ChunkRequest&) = default;
};

struct ChunkCancel {
    std::vector<std::uint32_t> request_ids;  ///< 1..kRequestsPerCancelMax

    friend bool operator==(const ChunkCancel&, const ChunkCancel&) = default;
};

/// The head of a Chunk answer; request_id 0: it belongs to the view. `payload_bytes` follow it in
/// the frame: more than 0 if and only if the status is full.
struct ChunkAnswer {
    std::uint32_t request_id = 0;
    ChunkPos key;
    ChunkFormat format = ChunkFormat::draco;
    ChunkStatus status = ChunkStatus::full;
    ChunkSource source = ChunkSource::generated;
    Hash128 etag;
    AnswerTimings timings;
    std::uint32_t payload_bytes = 0;
    WireComposition uniform;  ///< of a uniform chunk

    friend bool operator==(const ChunkAnswer&, const ChunkAnswer&) = default;
};

struct ColumnQuery {
    std::uint32_t request_id = 0;  ///< not 0
    ColumnPos column;              ///< |x|, |z| < kColumnCoordinateLimit

    friend bool operator==(const ColumnQuery&, const ColumnQuery&) = default;
};

struct WireLimit {
    std::int32_t y256 = 0;  ///< 1/256 voxel
    std::int8_t flow_x = 0;
    std::int8_t flow_y = 0;
    std::int8_t flow_z = 0;
    WireComposition composition;

    friend bool operator==(const WireLimit&, const WireLimit&) = default;
};

struct ColumnAnswer {
    std::uint32_t request_id = 0;
    ColumnPos column;
    std::vector<WireLimit> limits;  ///< bottom first

    friend bool operator==(const ColumnAnswer&, const ColumnAnswer&) = default;
};

struct WorldQuery {
    std::uint32_t request_id = 0;  ///< not 0

    friend bool operator==(const WorldQuery&, const WorldQuery&) = default;
};

struct WorldAnswer {
    std::uint32_t request_id = 0;
    std::string toml;  ///< the canonical world file
    Hash128 fingerprint;

    friend bool operator==(const WorldAnswer&, const WorldAnswer&) = default;
};

/// request_id 0: with a key, that chunk of the view; without, the session or the last message that
/// has no id. Another id: with a key, that key of the request; without, all of the request that is
/// not answered yet.
struct Failure {
    std::uint32_t request_id = 0;
    Error error{.code = ErrorCode::internal, .message = {}};
    std::uint32_t retry_after_ms = 0;  ///< of a `busy`; at most kRetryAfterMaxMs
    std::optional<ChunkPos> key;

    friend bool operator==(const Failure&, const Failure&) = default;
};

struct Ping {
    std::uint64_t nonce = 0;

    friend bool operator==(const Ping&, const Ping&) = default;
};

struct Pong {
    std::uint64_t nonce = 0;

    friend bool operator==(const Pong&, const Pong&) = default;
};

/// The sender stops: with an error code, or none if all is well.
struct Goodbye {
    std::optional<ErrorCode> code;
    std::string reason;

    friend bool operator==(const Goodbye&, const Goodbye&) = default;
};

/// World axes, y up.
struct WireVector {
    float x = 0;
    float y = 0;
    float z = 0;

    friend bool operator==(const WireVector&, const WireVector&) = default;
};

/// What the client wants to see from now on; terrane.fbs says which chunks that are.
struct ViewUpdate {
    double x = 0;  ///< the viewer, voxels of level 0; each within kColumnCoordinateLimit
    double y = 0;
    double z = 0;
    WireVector direction;     ///< of any length; zero: nowhere in particular
    float field_of_view = 0;  ///< whole angle, radians, 0..kFieldOfViewMax; 0: all around
    WireVector velocity;      ///< voxels a second
    std::vector<std::uint32_t> radius_chunks;  ///< one a level from 0, at most kViewLevelsMax
    ChunkFormat format = ChunkFormat::draco;
    bool without_flow = false;
    std::uint64_t bytes_per_second_max = 0;  ///< 0: as fast as the server sends

    friend bool operator==(const ViewUpdate&, const ViewUpdate&) = default;
};

struct ChunkForget {
    std::vector<ChunkPos> keys;  ///< 1..kKeysPerForgetMax

    friend bool operator==(const ChunkForget&, const ChunkForget&) = default;
};

struct Credit {
    std::uint64_t bytes = 0;

    friend bool operator==(const Credit&, const Credit&) = default;
};

using AnyMessage = std::variant<ClientHello, ServerHello, ChunkRequest, ChunkCancel, ChunkAnswer,
                                ColumnQuery, ColumnAnswer, WorldQuery, WorldAnswer, Failure, Ping,
                                Pong, Goodbye, ViewUpdate, ChunkForget, Credit>;

/// The schema's name of the message, e.g. "ChunkRequest": for logs and errors.
std::string_view name_of(const AnyMessage& message);

/// The message as the bytes `u32 length | head`. A ChunkAnswer's length counts its `payload_bytes`,
/// which the caller sends right behind; every other message is whole. Texts above their limit are
/// cut, lists above theirs are an assertion.
Bytes encode_message(const AnyMessage& message);

/// A verified frame as a value. `malformed` means that the peer doesn't speak the protocol: close
/// the connection. Every other code is about this one message (an unknown format is `unsupported`,
/// 0 or more than 64 keys or a view that isn't one `invalid_argument`, a far column or viewer
/// `out_of_range`): answer it with a Failure of `request_id_of` and go on.
Result<AnyMessage> decode_message(const Frame& frame);

/// Whether the frame is of a kind that this build knows: a client passes over others, which a newer
/// server may send.
bool is_known(const Frame& frame);

/// A message and what followed it; the payload lives until its reader is used again.
struct IncomingMessage {
    AnyMessage message;
    std::span<const std::byte> payload;
};

/// The next whole message of what `reader` was fed, nothing if more bytes are needed. Messages of
/// newer peers are passed over: for clients. Fails as FrameReader::next and decode_message do.
Result<std::optional<IncomingMessage>> next_message(FrameReader& reader);

/// The request id in a frame's head, 0 if that kind of message has none: what a Failure about a
/// message that did not decode refers to.
std::uint32_t request_id_of(const Frame& frame);

}  // namespace terrane
