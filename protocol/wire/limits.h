// The named limits of the native protocol; told in ServerHello where a client must know them.
#pragma once

#include <cstddef>
#include <cstdint>

namespace terrane {

inline constexpr std::uint32_t kProtocolVersion = 1;
inline constexpr std::size_t kInboundFrameBytesMax = std::size_t{64} << 10U;   ///< client to server
inline constexpr std::size_t kPayloadBytesMax = std::size_t{64} << 20U;        ///< server to client
inline constexpr std::size_t kKeysPerRequestMax = 64;
inline constexpr std::size_t kKeysInFlightPerSessionMax = 1024;
inline constexpr std::size_t kNameBytesMax = 256;

}  // namespace terrane
