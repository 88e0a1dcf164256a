#include "protocol/wire/messages.h"

#include "protocol/base/result.h"
#include "protocol/wire/frame.h"

#include <array>
#include <optional>
#include <string_view>
#include <utility>
#include <variant>

namespace terrane {

std::string_view to_string(ChunkFormat format) {
    switch (format) {
        case ChunkFormat::draco:
            return "draco";
        case ChunkFormat::columns:
            return "columns";
        case ChunkFormat::draco_blocky:
            return "blocky";
        case ChunkFormat::glb:
            return "glb";
    }
    return "unknown";
}

std::string_view to_string(ChunkStatus status) {
    switch (status) {
        case ChunkStatus::full:
            return "full";
        case ChunkStatus::empty:
            return "empty";
        case ChunkStatus::uniform:
            return "uniform";
        case ChunkStatus::not_modified:
            return "not_modified";
    }
    return "unknown";
}

std::string_view to_string(ChunkSource source) {
    switch (source) {
        case ChunkSource::generated:
            return "generated";
        case ChunkSource::store:
            return "store";
        case ChunkSource::cache:
            return "cache";
    }
    return "unknown";
}

std::string_view name_of(const AnyMessage& message) {
    // In the order of AnyMessage.
    constexpr std::array<std::string_view, std::variant_size_v<AnyMessage>> kNames = {
        "ClientHello", "ServerHello", "ChunkRequest",    "ChunkCancel", "Chunk", "ColumnQuery",
        "Column",      "WorldQuery",  "WorldDefinition", "Failure",     "Ping",  "Pong",
        "Goodbye",     "ViewUpdate",  "ChunkForget",     "Credit"};
    return kNames[message.index()];
}

Result<std::optional<IncomingMessage>> next_message(FrameReader& reader) {
    for (;;) {
        const auto next = reader.next();
        if (!next) {
            return tl::unexpected(next.error());
        }
        const std::optional<Frame>& frame = *next;
        if (!frame) {
            return std::nullopt;
        }
        if (!is_known(*frame)) {  // a newer server's: passed over
            continue;
        }
        auto message = decode_message(*frame);
        if (!message) {
            return tl::unexpected(message.error());
        }
        return IncomingMessage{.message = std::move(*message), .payload = frame->payload};
    }
}

}  // namespace terrane
