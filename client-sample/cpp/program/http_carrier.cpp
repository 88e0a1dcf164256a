#include "client-sample/cpp/program/http_carrier.h"

#include "client-sample/cpp/program/carrier.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <variant>

namespace terrane {

namespace {

constexpr int kOk = 200;
constexpr int kTooMany = 429;
constexpr int kUnavailable = 503;

Bytes bytes_from(const std::string& text) {
    const auto bytes = bytes_of(text);
    return {bytes.begin(), bytes.end()};
}

std::string_view trimmed(std::string_view text) {
    text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
    return text.substr(0, text.find_last_not_of(" \t\r") + 1);
}

template <typename Number>
bool read_number(std::string_view text, Number& number) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return error == std::errc() && end == text.data() + text.size();
}

}  // namespace

HttpCarrier::HttpCarrier(const CarrierAddress& address)
    : host_(address.host + ":" + std::to_string(address.port)) {}

std::string HttpCarrier::path_of(const Ask& ask) const {
    if (ask.what == What::world) {
        return "/v1/world";
    }
    if (ask.what == What::world_file) {
        return content_path_ + "/world.toml";
    }
    const std::string ending = ask.format == ChunkFormat::columns        ? ".columns"
                               : ask.format == ChunkFormat::draco_blocky ? ".blocky.drc"
                                                                         : ".drc";
    return content_path_ + "/chunks/" + std::to_string(ask.key.lod) + "/" +
           std::to_string(ask.key.x) + "/" + std::to_string(ask.key.y) + "/" +
           std::to_string(ask.key.z) + ending;
}

void HttpCarrier::ask(const Ask& ask) {
    if (asks_.size() < kHttpAsksMax) {
        asks_.push_back(ask);
    }
}

Bytes HttpCarrier::wrap(const AnyMessage& message) {
    if (const auto* hello = std::get_if<ClientHello>(&message)) {
        token_ = hello->token;
        ask({});
    } else if (const auto* query = std::get_if<WorldQuery>(&message)) {
        ask({.what = What::world_file, .request_id = query->request_id, .key = {}, .format = {}});
    } else if (const auto* request = std::get_if<ChunkRequest>(&message)) {
        for (const ChunkPos key : request->keys) {
            ask({.what = What::chunk,
                 .request_id = request->request_id,
                 .key = key,
                 .format = request->format});
        }
    }
    return take_reply();
}

Bytes HttpCarrier::take_reply() {
    if (asked_ || asks_.empty()) {
        return {};
    }
    asked_ = asks_.front();
    asks_.pop_front();
    std::string text = "GET " + path_of(*asked_) + " HTTP/1.1\r\nHost: " + host_ + "\r\n";
    if (!token_.empty()) {
        text += "Authorization: Bearer " + token_ + "\r\n";
    }
    return bytes_from(text + "\r\n");
}

Result<void> HttpCarrier::feed(std::span<const std::byte> bytes) {
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(taken_bytes_));
    taken_bytes_ = 0;
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
    return {};
}

/// False if the answer is not whole yet.
Result<bool> HttpCarrier::read(Response& response) {
    const std::span<const std::byte> rest = std::span(buffer_).subspan(taken_bytes_);
    const std::string_view text = text_of(rest);
    const std::size_t end = text.find("\r\n\r\n");
    if (end == text.npos) {
        if (text.size() > kHttpHeadBytesMax) {
            return fail(ErrorCode::too_large, "HTTP: an answer's head has no end");
        }
        return false;
    }
    std::string_view head = text.substr(0, end);
    const std::size_t first_end = std::min(head.find("\r\n"), head.size());
    if (!head.starts_with("HTTP/1.1 ") || !read_number(head.substr(9, 3), response.status)) {
        return fail(ErrorCode::malformed,
                    "HTTP: the answer begins with " + std::string(head.substr(0, 40)));
    }
    head.remove_prefix(first_end);
    while (head.starts_with("\r\n")) {
        head.remove_prefix(2);
        const std::string_view line = head.substr(0, head.find("\r\n"));
        const std::size_t colon = std::min(line.find(':'), line.size());
        std::string name(line.substr(0, colon));
        std::ranges::transform(name, name.begin(),
                               [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
        response.headers[name] = trimmed(line.substr(std::min(colon + 1, line.size())));
        head.remove_prefix(line.size());
    }
    std::uint64_t length = 0;
    if (const auto found = response.headers.find("content-length");
        found == response.headers.end() || !read_number(std::string_view(found->second), length)) {
        return fail(ErrorCode::malformed, "HTTP: an answer without Content-Length");
    }
    if (length > kPayloadBytesMax) {
        return fail(ErrorCode::too_large,
                    "HTTP: an answer of " + std::to_string(length) + " bytes");
    }
    if (rest.size() - end - 4 < length) {
        return false;
    }
    response.body = rest.subspan(end + 4, static_cast<std::size_t>(length));
    return true;
}

Result<std::optional<IncomingMessage>> HttpCarrier::next() {
    if (!asked_) {
        if (taken_bytes_ < buffer_.size()) {
            return fail(ErrorCode::malformed, "HTTP: bytes that nobody asked for");
        }
        return std::nullopt;
    }
    Response response;
    const auto is_whole = read(response);
    if (!is_whole) {
        return tl::unexpected(is_whole.error());
    }
    if (!*is_whole) {
        return std::nullopt;
    }
    const Ask ask = *asked_;
    asked_.reset();
    taken_bytes_ =
        static_cast<std::size_t>(response.body.data() + response.body.size() - buffer_.data());
    auto message = message_of(ask, response);
    if (!message) {
        return tl::unexpected(message.error());
    }
    const bool has_payload = std::holds_alternative<ChunkAnswer>(*message);
    return IncomingMessage{.message = std::move(*message),
                           .payload = has_payload ? response.body : std::span<const std::byte>()};
}

Result<AnyMessage> HttpCarrier::message_of(const Ask& ask, const Response& response) {
    if (response.status != kOk) {
        const bool is_busy = response.status == kTooMany || response.status == kUnavailable;
        std::uint32_t retry_after_s = 1;
        if (const auto found = response.headers.find("retry-after");
            found != response.headers.end()) {
            read_number(std::string_view(found->second), retry_after_s);
        }
        const std::string_view body = text_of(response.body);
        return Failure{.request_id = ask.request_id,
                       .error = {.code = is_busy ? ErrorCode::busy : ErrorCode::not_found,
                                 .message = "HTTP " + std::to_string(response.status) + " for " +
                                            path_of(ask) + ": " + std::string(body.substr(0, 300))},
                       .retry_after_ms = std::min(retry_after_s, 60U) * 1000,
                       .key = ask.what == What::chunk ? std::optional(ask.key) : std::nullopt};
    }
    if (ask.what == What::world) {
        return hello_of(response);
    }
    if (ask.what == What::world_file) {
        return WorldAnswer{.request_id = ask.request_id,
                           .toml = std::string(text_of(response.body)),
                           .fingerprint = hello_.fingerprint};
    }
    ChunkAnswer answer{.request_id = ask.request_id,
                       .key = ask.key,
                       .format = ask.format,
                       .status = ChunkStatus::full,
                       .source = ChunkSource::cache,
                       .etag = {},
                       .timings = {},
                       .payload_bytes = static_cast<std::uint32_t>(response.body.size()),
                       .uniform = {}};
    if (response.body.empty()) {
        const auto status = response.headers.find("terrane-status");
        const bool is_uniform =
            status != response.headers.end() && status->second.starts_with("uniform");
        answer.status = is_uniform ? ChunkStatus::uniform : ChunkStatus::empty;
        answer.uniform = is_uniform ? composition_of(status->second) : WireComposition();
    }
    return answer;
}

/// "uniform; material=NAME" or "uniform; material=NAME SHARE, NAME SHARE"; six decimals.
WireComposition HttpCarrier::composition_of(std::string_view status) const {
    WireComposition composition;
    status.remove_prefix(std::min(status.find('=') + 1, status.size()));
    while (!status.empty() && composition.size() < kWireSharesMax) {
        const std::size_t end = std::min(status.find(','), status.size());
        std::string_view part = trimmed(status.substr(0, end));
        status.remove_prefix(std::min(end + 1, status.size()));
        double concentration = 1;
        if (const std::size_t space = part.rfind(' ');
            space != part.npos && read_number(part.substr(space + 1), concentration)) {
            part = part.substr(0, space);
        }
        const auto found = std::ranges::find(hello_.materials, part, &WireMaterial::name);
        if (found != hello_.materials.end()) {
            composition.push_back(
                {.material = static_cast<std::uint16_t>(found - hello_.materials.begin()),
                 .concentration = concentration});
        }
    }
    return composition;
}

Result<AnyMessage> HttpCarrier::hello_of(const Response& response) {
    const auto json = nlohmann::json::parse(text_of(response.body), nullptr, false);
    ServerHello hello;
    try {
        hello.protocol_version = kProtocolVersion;
        hello.world_name = json.at("name").get<std::string>();
        const auto fingerprint = hash_from_hex(json.at("fingerprint").get<std::string>());
        const auto content_id = hash_from_hex(json.at("content_id").get<std::string>());
        hello.chunk_side = json.at("chunk_side_columns").get<std::int32_t>();
        hello.chunk_height = json.at("chunk_height_voxels").get<std::int32_t>();
        hello.voxel_size_m = json.at("voxel_size_m").get<double>();
        hello.levels = json.at("levels").get<std::int32_t>();
        hello.height_bound_voxels = json.at("bounds").at("height_voxels").get<double>();
        for (const auto& material : json.at("materials")) {
            hello.materials.push_back({.name = material.at("name").get<std::string>(),
                                       .color_rgb = 0,
                                       .texture = {},
                                       .solid = material.at("solid").get<bool>()});
        }
        if (!fingerprint || !content_id || hello.chunk_side < 1 ||
            hello.chunk_side > kWireSideMax || hello.chunk_height < 1 ||
            hello.chunk_height > kWireSideMax || hello.levels < 1 || hello.levels > kLodMax + 1 ||
            !std::isfinite(hello.height_bound_voxels) ||
            hello.materials.size() > kWireMaterialsMax) {
            return fail(ErrorCode::malformed, "HTTP: /v1/world describes no world");
        }
        hello.fingerprint = *fingerprint;
        hello.content_id = *content_id;
    } catch (const nlohmann::json::exception& error) {
        return fail(ErrorCode::malformed, std::string("HTTP: /v1/world: ") + error.what());
    }
    // What HTTP holds a client to is its own: one request at a time.
    hello.limits.keys_per_request_max = kKeysPerRequestMax;
    hello.limits.keys_in_flight_max = kKeysPerRequestMax;
    hello.limits.view_radius_max = 64;
    content_path_ = "/v1/w/" + to_hex(hello.content_id);
    hello_ = hello;
    return hello;
}

}  // namespace terrane
