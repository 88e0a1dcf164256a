// The native protocol on a connection of its own: a Session and nothing around it.
#pragma once

#include "server/net/byte_protocol.h"
#include "server/net/session.h"

namespace terrane {

/// `context` outlives what the factory makes.
ProtocolFactory native_protocol(const SessionContext& context);

}  // namespace terrane
