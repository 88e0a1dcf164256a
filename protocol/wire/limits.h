// The named limits of the native protocol; told in ServerHello where a client must know them.
#pragma once

#include "protocol/base/coords.h"

#include <cstddef>
#include <cstdint>

namespace terrane {

inline constexpr std::uint32_t kProtocolVersion = 1;

inline constexpr std::size_t kInboundFrameBytesMax = std::size_t{64} << 10U;  ///< client to server
inline constexpr std::size_t kPayloadBytesMax = std::size_t{64} << 20U;       ///< server to client
/// Heads from a server: the largest is a world file (1 MiB) with its table around it.
inline constexpr std::size_t kOutboundHeadBytesMax = std::size_t{2} << 20U;
/// What a COLUMNS payload may grow to when decompressed.
inline constexpr std::size_t kColumnChunkBytesMax = std::size_t{64} << 20U;

inline constexpr std::size_t kKeysPerRequestMax = 64;
inline constexpr std::size_t kKeysInFlightPerSessionMax = 1024;
inline constexpr std::size_t kRequestsPerCancelMax = 1024;
inline constexpr std::size_t kViewLevelsMax = static_cast<std::size_t>(kLodMax) + 1;
inline constexpr float kFieldOfViewMax = 6.2831855F;    ///< 2 pi: all around
inline constexpr std::size_t kKeysPerForgetMax = 4096;  ///< of one ChunkForget
/// Chunk bytes of a view that may be sent and not yet credited, where nothing else is set.
inline constexpr std::size_t kCreditWindowBytes = std::size_t{256} << 10U;

inline constexpr std::size_t kWireNameBytesMax = 256;
inline constexpr std::size_t kTokenBytesMax = 4096;
inline constexpr std::size_t kTextBytesMax = 4096;  ///< a Failure's message, a Goodbye's reason
inline constexpr std::size_t kWorldTextBytesMax = std::size_t{1} << 20U;
inline constexpr double kWireVoxelSizeMinM = 0.001;
inline constexpr double kWireVoxelSizeMaxM = 1000;
inline constexpr std::int32_t kWireSideMax = 64;  ///< columns or voxels
inline constexpr std::size_t kWireMaterialsMax = 256;
inline constexpr std::size_t kWireSharesMax = 16;
inline constexpr std::size_t kWireLimitsMax = 65536;  ///< limits of one column
inline constexpr std::uint32_t kRetryAfterMaxMs = 60'000;

/// Most FlatBuffers tables in one head, and how deep they may nest. A client's messages have two.
/// A column's limit costs two tables and one a share.
inline constexpr std::uint32_t kInboundTablesMax = 16;
inline constexpr std::uint32_t kOutboundTablesMax = 1U << 20U;
inline constexpr std::uint32_t kTableDepthMax = 8;

}  // namespace terrane
