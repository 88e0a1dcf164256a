#include "client-sample/cpp/program/get_report.h"

#include "protocol/base/coords.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <iterator>
#include <span>
#include <string>
#include <vector>

namespace terrane {

namespace {

constexpr std::size_t kColumns = 10;
using Line = std::array<std::string, kColumns>;

std::string milliseconds(std::int64_t microseconds) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.3f", static_cast<double>(microseconds) / 1000);
    return text.data();
}

std::string key_text(ChunkPos key) {
    return std::to_string(key.lod) + "/" + std::to_string(key.x) + "/" + std::to_string(key.y) +
           "/" + std::to_string(key.z);
}

Line line_of(const GetRow& row) {
    if (row.error || !row.answer) {
        return {key_text(row.key), row.error ? std::string(to_string(row.error->code)) : "missing"};
    }
    const ChunkAnswer& answer = *row.answer;
    return {key_text(row.key),
            std::string(to_string(answer.status)),
            std::string(to_string(answer.source)),
            std::to_string(answer.payload_bytes),
            std::to_string(row.triangle_count),
            milliseconds(answer.timings.queue_us),
            milliseconds(answer.timings.generate_us),
            milliseconds(answer.timings.mesh_us),
            milliseconds(answer.timings.encode_us),
            milliseconds(row.waited.count())};
}

nlohmann::ordered_json json_of(const GetRow& row, const ChunkAnswer& answer,
                               const ServerHello& world) {
    nlohmann::ordered_json json = {{"lod", row.key.lod},
                                   {"x", row.key.x},
                                   {"y", row.key.y},
                                   {"z", row.key.z},
                                   {"status", to_string(answer.status)},
                                   {"source", to_string(answer.source)},
                                   {"bytes", answer.payload_bytes},
                                   {"triangles", row.triangle_count},
                                   {"hash", to_hex(row.payload_hash)},
                                   {"etag", to_hex(answer.etag)},
                                   {"queue_us", answer.timings.queue_us},
                                   {"generate_us", answer.timings.generate_us},
                                   {"mesh_us", answer.timings.mesh_us},
                                   {"encode_us", answer.timings.encode_us},
                                   {"waited_us", row.waited.count()}};
    if (answer.status == ChunkStatus::uniform) {
        auto& composition = json["composition"] = nlohmann::ordered_json::object();
        for (const WireShare& share : answer.uniform) {
            const bool is_named = share.material < world.materials.size();
            composition[is_named ? world.materials[share.material].name
                                 : std::to_string(share.material)] = share.concentration;
        }
    }
    return json;
}

}  // namespace

std::string report_table(std::span<const GetRow> rows) {
    std::vector<Line> lines = {{"lod/x/y/z", "status", "source", "bytes", "triangles", "queue ms",
                                "generate ms", "mesh ms", "encode ms", "waited ms"}};
    std::ranges::transform(rows, std::back_inserter(lines), line_of);
    std::array<std::size_t, kColumns> widths{};
    for (const Line& line : lines) {
        for (std::size_t i = 0; i < kColumns; ++i) {
            widths[i] = std::max(widths[i], line[i].size());
        }
    }
    std::string table;
    for (const Line& line : lines) {
        std::string text;
        for (std::size_t i = 0; i < kColumns; ++i) {
            const std::string padding(widths[i] - line[i].size(), ' ');
            const bool is_number = i >= 3;
            text += (i == 0 ? "" : "  ") + (is_number ? padding + line[i] : line[i] + padding);
        }
        text.erase(text.find_last_not_of(' ') + 1);
        table += text + "\n";
    }
    return table;
}

std::string report_json(std::span<const GetRow> rows, const ServerHello& world) {
    nlohmann::ordered_json json = {{"chunks", nlohmann::ordered_json::array()}};
    for (const GetRow& row : rows) {
        if (row.answer && !row.error) {
            json["chunks"].push_back(json_of(row, *row.answer, world));
        } else {
            const Error error =
                row.error.value_or(Error{.code = ErrorCode::io_error, .message = "no answer"});
            json["failures"].push_back({{"lod", row.key.lod},
                                        {"x", row.key.x},
                                        {"y", row.key.y},
                                        {"z", row.key.z},
                                        {"code", to_string(error.code)},
                                        {"message", error.message}});
        }
    }
    return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace terrane
