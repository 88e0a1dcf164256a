#include "client-sample/cpp/program/get.h"

#include "client-sample/cpp/chunk_reader.h"
#include "client-sample/cpp/client.h"
#include "client-sample/cpp/connection.h"
#include "client-sample/cpp/program/door_flags.h"
#include "client-sample/cpp/program/get_report.h"
#include "client-sample/cpp/program/obj.h"
#include "client-sample/cpp/program/program.h"
#include "generator/mesh/mesh.h"
#include "protocol/base/bytes.h"
#include "protocol/base/coords.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "protocol/base/write_file.h"
#include "protocol/wire/messages.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <variant>
#include <vector>

namespace terrane {

namespace {

using std::chrono::steady_clock;

void complain(const std::string& text) {
    std::fprintf(stderr, "terrane-client: %s\n", text.c_str());
}

std::string file_stem(ChunkPos key) {
    return std::to_string(key.lod) + "_" + std::to_string(key.x) + "_" + std::to_string(key.y) +
           "_" + std::to_string(key.z);
}

std::string_view extension_of(ChunkFormat format) {
    return format == ChunkFormat::draco_blocky ? "blocky.draco" : to_string(format);
}

/// Where payloads and OBJ files go.
struct Places {
    std::filesystem::path output;  ///< empty: payloads are not written
    bool is_folder = false;

    std::filesystem::path payload_of(ChunkPos key, ChunkFormat format) const {
        return is_folder ? output / (file_stem(key) + "." + std::string(extension_of(format)))
                         : output;
    }

    std::filesystem::path obj_of(ChunkPos key) const {
        if (is_folder || output.empty()) {
            return output / (file_stem(key) + ".obj");
        }
        return std::filesystem::path(output) += ".obj";
    }
};

Result<Places> prepare_places(const GetOptions& options) {
    Places places{.output = options.output, .is_folder = false};
    if (options.output.empty()) {
        return places;
    }
    std::error_code error;
    places.is_folder = options.keys.size() > 1 || !options.output.has_filename() ||
                       std::filesystem::is_directory(options.output, error);
    if (places.is_folder) {
        std::filesystem::create_directories(options.output, error);
        if (error) {
            return fail(
                ErrorCode::io_error,
                options.output.string() + ": no such folder can be made: " + error.message());
        }
    }
    return places;
}

/// Decodes a chunk and writes its files; the row tells what came of it.
void settle_chunk(GetRow& row, const ReceivedChunk& chunk, const Places& places,
                  const GetOptions& options, const ServerHello& world) {
    row.answer = chunk.answer;
    row.waited = chunk.waited;
    row.payload_hash = hash128(chunk.payload);
    const auto content = read_chunk(chunk.answer, chunk.payload, world);
    if (!content) {
        row.error = content.error();
        return;
    }
    row.triangle_count = content->triangle_count();
    if (!places.output.empty()) {
        if (const auto written =
                write_file(places.payload_of(row.key, options.format), chunk.payload);
            !written) {
            row.error = written.error();
        }
    }
    if (const std::optional<Mesh>& mesh = content->mesh; options.obj && mesh) {
        const std::string text = obj_of(*mesh, row.key, world);
        if (const auto written = write_file(places.obj_of(row.key), bytes_of(text)); !written) {
            row.error = written.error();
        }
    }
}

/// Fills the rows as answers come; an error is about the session, not about one chunk.
Result<void> fetch(Client& client, std::vector<GetRow>& rows, const Places& places,
                   const GetOptions& options, Deadline deadline) {
    std::map<ChunkPos, GetRow*> row_of;
    for (GetRow& row : rows) {
        row_of.emplace(row.key, &row);
    }
    if (const auto requested = client.request(options.keys, options.format); !requested) {
        return tl::unexpected(requested.error());
    }
    while (client.unanswered() > 0) {
        const auto next = client.next(deadline);
        if (!next) {
            return tl::unexpected(next.error());
        }
        const std::optional<ClientEvent>& event = *next;
        if (!event) {
            return fail(ErrorCode::io_error, std::to_string(client.unanswered()) + " of " +
                                                 std::to_string(rows.size()) +
                                                 " chunks did not come in time");
        }
        if (const auto* chunk = std::get_if<ReceivedChunk>(&*event)) {
            settle_chunk(*row_of.at(chunk->answer.key), *chunk, places, options, client.hello());
        } else if (const auto* failure = std::get_if<Failure>(&*event)) {
            if (!failure->key) {
                return tl::unexpected(failure->error);
            }
            row_of.at(*failure->key)->error = failure->error;
        }
    }
    return {};
}

}  // namespace

Result<Address> parse_address(std::string_view text) {
    const auto wrong = [&] {
        return fail(ErrorCode::invalid_argument,
                    "'" + std::string(text) + "' is not HOST:PORT with a port of 1..65535");
    };
    std::string_view host = text;
    std::string_view port_text;
    if (const std::size_t bracket = text.rfind(']');
        text.starts_with('[') && bracket != text.npos) {
        host = text.substr(1, bracket - 1);
        port_text = text.substr(bracket + 1);
    } else if (const std::size_t colon = text.rfind(':'); colon != text.npos) {
        host = text.substr(0, colon);
        port_text = text.substr(colon);
    }
    Address address{.host = std::string(host), .port = kDefaultPort};
    if (!port_text.empty()) {
        const char* first = port_text.data() + 1;
        const char* last = port_text.data() + port_text.size();
        const auto [end, error] = std::from_chars(first, last, address.port);
        if (port_text[0] != ':' || error != std::errc() || end != last) {
            return wrong();
        }
    }
    if (address.host.empty() || address.port == 0) {
        return wrong();
    }
    return address;
}

Result<ChunkPos> parse_chunk(std::string_view text, std::int32_t lod) {
    ChunkPos chunk{.lod = lod, .x = 0, .y = 0, .z = 0};
    const char* at = text.data();
    const char* const last = text.data() + text.size();
    for (std::int32_t* coordinate : {&chunk.x, &chunk.y, &chunk.z}) {
        const auto [end, error] = std::from_chars(at, last, *coordinate);
        if (error == std::errc::result_out_of_range) {
            return fail(
                ErrorCode::out_of_range,
                "'" + std::string(text) + "': chunk coordinates are -2147483648..2147483647");
        }
        const bool is_last = coordinate == &chunk.z;
        if (error != std::errc() || (is_last ? end != last : end == last || *end != ',')) {
            return fail(ErrorCode::invalid_argument,
                        "'" + std::string(text) + "' is not X,Y,Z, three integers without spaces");
        }
        at = is_last ? end : end + 1;
    }
    return chunk;
}

int run_get(const GetOptions& options) {
    const auto begin = steady_clock::now();
    const Deadline deadline = begin + std::chrono::duration_cast<steady_clock::duration>(
                                          std::chrono::duration<double>(options.timeout_s));
    const auto places = prepare_places(options);
    if (!places) {
        complain(places.error().message);
        return kClientFailed;
    }
    auto client =
        Client::connect({.host = options.host,
                         .port = options.port,
                         .timeout = std::chrono::ceil<std::chrono::milliseconds>(deadline - begin),
                         .client_name = "terrane-client",
                         .token = options.token,
                         .tls = options.tls});
    if (!client) {
        complain(client.error().message);
        return kClientFailed;
    }
    std::vector<GetRow> rows;
    for (const ChunkPos key : options.keys) {
        rows.emplace_back().key = key;
    }
    const auto fetched = fetch(*client, rows, *places, options, deadline);
    const std::string report =
        options.json ? report_json(rows, client->hello()) : report_table(rows);
    std::fwrite(report.data(), 1, report.size(), stdout);
    std::fflush(stdout);
    bool is_good = fetched.has_value();
    if (!fetched) {
        complain(fetched.error().message);
    }
    for (const GetRow& row : rows) {
        if (row.error) {
            complain("chunk " + file_stem(row.key) + ": " +
                     std::string(to_string(row.error->code)) + ": " + row.error->message);
            is_good = false;
        }
    }
    return is_good ? kClientDone : kClientFailed;
}

namespace {

constexpr double kTimeoutMinS = 0.001;
constexpr double kTimeoutMaxS = 86400;

/// As CLI11 gives them, before they are understood.
struct GetFlags {
    std::vector<std::string> at;
    std::string server = "127.0.0.1:7777";
    std::int32_t lod = 0;
    std::string format = "draco";
    std::string output;
    GetOptions options;
};

ChunkFormat format_named(std::string_view name) {
    if (name == to_string(ChunkFormat::draco)) {
        return ChunkFormat::draco;
    }
    return name == to_string(ChunkFormat::columns) ? ChunkFormat::columns
                                                   : ChunkFormat::draco_blocky;
}

Result<GetOptions> understood(const GetFlags& flags) {
    GetOptions options = flags.options;
    const auto address = parse_address(flags.server);
    if (!address) {
        return fail(address.error().code, "--server: " + address.error().message);
    }
    if (flags.lod < 0 || flags.lod > kLodMax) {
        return fail(ErrorCode::invalid_argument,
                    "--lod: there are levels 0 to " + std::to_string(kLodMax));
    }
    options.host = address->host;
    options.port = address->port;
    for (const std::string& text : flags.at) {
        const auto chunk = parse_chunk(text, flags.lod);
        if (!chunk) {
            return fail(chunk.error().code, "--at: " + chunk.error().message);
        }
        if (chunk->lod > 0 && chunk->y != 0) {
            return fail(ErrorCode::invalid_argument,
                        "--at: '" + text +
                            "': above level 0 a chunk has its columns' whole height, "
                            "so y must be 0");
        }
        if (std::ranges::find(options.keys, *chunk) == options.keys.end()) {
            options.keys.push_back(*chunk);
        }
    }
    options.format = format_named(flags.format);
    if (options.obj && options.format == ChunkFormat::columns) {
        return fail(ErrorCode::invalid_argument,
                    "--obj: columns have no mesh; use --format draco or blocky");
    }
    // Not CLI::Range, which lets NaN pass.
    if (!(options.timeout_s >= kTimeoutMinS && options.timeout_s <= kTimeoutMaxS)) {
        return fail(ErrorCode::invalid_argument, "--timeout: 0.001 to 86400 seconds are possible");
    }
    options.output = flags.output;
    return options;
}

}  // namespace

void add_get_command(CLI::App& app, int& exit_code) {
    const auto flags = std::make_shared<GetFlags>();
    CLI::App* get =
        app.add_subcommand("get", "Fetch chunks, check that they decode, and say what came");
    get->add_option("--at", flags->at,
                    "Chunk to fetch, X,Y,Z in chunks (y is up); may be given many times")
        ->required()
        ->expected(1)
        ->take_all()
        ->type_name("X,Y,Z");
    get->add_option("--server", flags->server, "Where the server listens")
        ->type_name("HOST:PORT")
        ->capture_default_str();
    add_door_flags(*get, flags->options.token, flags->options.tls);
    get->add_option(
           "--lod", flags->lod,
           "Level of detail, 0..17: every 2^L-th column; above 0 a chunk is its columns' whole "
           "height, and its y is 0")
        ->type_name("L")
        ->capture_default_str();
    get->add_option("--format", flags->format,
                    "draco: a smooth mesh; blocky: a mesh of blocks, level 0 only; columns: the "
                    "limits that both are made of")
        ->check(CLI::IsMember({"draco", "blocky", "columns"}))
        ->capture_default_str();
    get->add_option("-o,--output", flags->output,
                    "Write the payload to this file; several go to this folder as "
                    "LOD_X_Y_Z.draco|blocky.draco|columns")
        ->type_name("FILE|DIR");
    get->add_flag("--obj", flags->options.obj,
                  "Write the mesh beside it as Wavefront OBJ, in world metres");
    get->add_flag("--json", flags->options.json, "Print JSON in place of the table");
    get->add_option("--timeout", flags->options.timeout_s, "Give up after this long")
        ->type_name("SECONDS")
        ->capture_default_str();
    get->footer(
        "Chunks without a surface are empty or uniform: 0 bytes, and an empty file with -o.\n"
        "Exit code: 0 all came and decoded, 1 something did not, 2 wrong use.\n"
        "Examples:\n"
        "  terrane-client get --at 0,0,0                            one chunk, as a table\n"
        "  terrane-client get --at -1,2,0 --at 0,2,0 -o chunks/     two of them, into a folder\n"
        "  terrane-client get --at 0,1,0 -o hill.draco --obj        and hill.draco.obj for a 3D "
        "program\n"
        "  terrane-client get --at 0,0,0 --format columns --json    for programs");
    get->callback([flags, &exit_code] {
        const auto options = understood(*flags);
        if (!options) {
            complain(options.error().message);
            exit_code = kClientWrongUse;
            return;
        }
        exit_code = run_get(*options);
    });
}

}  // namespace terrane
