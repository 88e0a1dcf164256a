// The native messages over WebSocket, at /ws: what a Session writes, each message whole in one
// binary frame; what the client sends, in binary messages however cut.
//
// A Session's outbox is shared with nobody and copied by nobody: heads of WebSocket frames are
// woven between its parts as they are gathered. A message's own first four bytes tell its length.
#pragma once

#include "server/net/byte_protocol.h"
#include "server/net/http_session.h"
#include "server/net/session.h"

#include <string>

namespace terrane {

inline constexpr std::string_view kWebSocketPath = "/ws";

/// `context` outlives what is made.
WebSocketUpgrade websocket_upgrade(const SessionContext& context);

/// The answer that accepts a handshake.
std::string websocket_handshake(std::string_view key);

}  // namespace terrane
