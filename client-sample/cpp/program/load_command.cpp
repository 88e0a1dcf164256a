// The command line of `terrane-client load`.
#include "client-sample/cpp/program/carrier.h"
#include "client-sample/cpp/program/door_flags.h"
#include "client-sample/cpp/program/get.h"
#include "client-sample/cpp/program/load.h"
#include "client-sample/cpp/program/load_report.h"
#include "client-sample/cpp/program/movement.h"
#include "client-sample/cpp/program/program.h"
#include "protocol/base/result.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"

#include <CLI/CLI.hpp>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <ios>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace terrane {

namespace {

constexpr std::size_t kPathFileBytesMax = std::size_t{64} << 20U;
constexpr std::uint32_t kLoadRadiusMax = 32;

/// As CLI11 gives them, before they are understood.
struct LoadFlags {
    std::string server;
    std::string move = "walk";
    std::string path;
    std::string format = "draco";
    std::string by = "view";
    bool ws = false;
    bool http = false;
    std::vector<double> at = {0, 0};
    double patience_seconds = 10;
    LoadOptions options;
};

void complain(const std::string& text) {
    std::fprintf(stderr, "terrane-client: load: %s\n", text.c_str());
}

Result<std::string> read_text(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::string text;
    std::string block(std::size_t{64} << 10U, '\0');
    while (file) {
        file.read(block.data(), static_cast<std::streamsize>(block.size()));
        text.append(block.data(), static_cast<std::size_t>(file.gcount()));
        if (text.size() > kPathFileBytesMax) {
            return fail(ErrorCode::too_large, path + ": larger than 64 MiB");
        }
    }
    if (!file.eof()) {
        return fail(ErrorCode::io_error, path + ": can't be read");
    }
    return text;
}

Result<LoadOptions> understood(const LoadFlags& flags) {
    LoadOptions options = flags.options;
    const bool is_by_http = flags.ws || flags.http;
    const auto address = parse_address(!flags.server.empty() ? flags.server
                                       : is_by_http          ? "127.0.0.1:8080"
                                                             : "127.0.0.1:7777");
    if (!address) {
        return fail(address.error().code, "--server: " + address.error().message);
    }
    options.host = address->host;
    options.port = address->port;
    options.carrier = flags.ws     ? CarrierKind::web_socket
                      : flags.http ? CarrierKind::http
                                   : CarrierKind::tcp;
    static const std::map<std::string, std::vector<MovementKind>> kMovements = {
        {"walk", {MovementKind::walk}},
        {"fly", {MovementKind::fly}},
        {"teleport", {MovementKind::teleport}},
        {"mix", {MovementKind::walk, MovementKind::fly, MovementKind::teleport}}};
    options.movements = kMovements.at(flags.move);
    if (!flags.path.empty()) {
        const auto text = read_text(flags.path);
        auto path = text ? parse_path(*text) : tl::unexpected(text.error());
        if (!path) {
            return fail(path.error().code, "--path " + flags.path + ": " + path.error().message);
        }
        options.path = std::make_shared<const std::vector<PathPoint>>(std::move(*path));
        options.movements = {MovementKind::path};
    }
    // By half of the time at the latest all have come.
    options.ramp_seconds = std::min(options.ramp_seconds, options.seconds / 2);
    options.at_x = flags.at[0];
    options.at_z = flags.at[1];
    options.client.format = flags.format == "columns"  ? ChunkFormat::columns
                            : flags.format == "blocky" ? ChunkFormat::draco_blocky
                                                       : ChunkFormat::draco;
    options.client.by_view = flags.by == "view" && !flags.http;
    options.client.patience =
        std::chrono::milliseconds(static_cast<std::int64_t>(flags.patience_seconds * 1000));
    return options;
}

/// A line that is written over again on a terminal, lines elsewhere.
class ProgressLine {
  public:
    void tell(const std::string& text) {
        std::fprintf(stderr, is_terminal_ ? "\r%s\x1b[K" : "%s\n", text.c_str());
        std::fflush(stderr);
        is_told_ = true;
    }

    ~ProgressLine() {
        if (is_terminal_ && is_told_) {
            std::fputc('\n', stderr);
        }
    }

  private:
    bool is_terminal_ = ::isatty(STDERR_FILENO) == 1;
    bool is_told_ = false;
};

int run_load_command(const LoadFlags& flags) {
    const auto options = understood(flags);
    if (!options) {
        complain(options.error().message);
        return kClientWrongUse;
    }
    auto result = [&] {
        ProgressLine line;
        return run_load(*options, [&](const std::string& text) { line.tell(text); });
    }();
    if (!result) {
        complain(result.error().message);
        return kClientFailed;
    }
    const std::string report = options->json ? load_json(*result) : load_text(*result);
    std::fwrite(report.data(), 1, report.size(), stdout);
    std::fflush(stdout);
    return result->is_good() ? kClientDone : kClientFailed;
}

void add_what_clients_do(CLI::App& load, LoadFlags& flags) {
    load.add_option("--move", flags.move,
                    "walk (4.5 voxels a second), fly (50), teleport (a jump about every 5 s), or "
                    "mix: a third each")
        ->check(CLI::IsMember({"walk", "fly", "teleport", "mix"}))
        ->capture_default_str();
    load.add_option("--path", flags.path,
                    "Follow a recorded path instead: lines of SECONDS X Y Z in voxels; clients "
                    "begin spread over its length, and at its end begin again")
        ->type_name("FILE");
    load.add_option("--radius", flags.options.client.radius_chunks,
                    "The view: a radius for each level from 0 up, in its chunk sides")
        ->delimiter(',')
        ->expected(1, static_cast<int>(kViewLevelsMax))
        ->check(CLI::Range(std::uint32_t{0}, kLoadRadiusMax))
        ->type_name("R0,R1,..")
        ->capture_default_str();
    load.add_option("--format", flags.format, "draco, blocky or columns")
        ->check(CLI::IsMember({"draco", "blocky", "columns"}))
        ->capture_default_str();
    load.add_option("--by", flags.by,
                    "view: the server is told the view and decides the order; request: the client "
                    "asks for each chunk by its key")
        ->check(CLI::IsMember({"view", "request"}))
        ->capture_default_str();
    load.add_option("--at", flags.at, "Centre of the crowd, voxels")
        ->delimiter(',')
        ->expected(2)
        ->check(CLI::Range(-9e15, 9e15))
        ->type_name("X,Z")
        ->capture_default_str();
    load.add_option("--spread", flags.options.spread_voxels,
                    "How far from there clients begin, voxels; wider means less shared work")
        ->check(CLI::Range(0.0, 1e9))
        ->capture_default_str();
    load.add_option("--seed", flags.options.seed, "Of where they begin and turn")
        ->capture_default_str();
}

}  // namespace

void add_load_command(CLI::App& app, int& exit_code) {
    const auto flags = std::make_shared<LoadFlags>();
    CLI::App* load =
        app.add_subcommand("load", "Many clients at once: what does this server bear?");
    load->add_option("--server", flags->server,
                     "Where the server listens; 127.0.0.1:7777 if absent, with --ws and --http "
                     "127.0.0.1:8080")
        ->type_name("HOST:PORT");
    load->add_option("--clients", flags->options.clients, "How many")
        ->check(CLI::Range(std::size_t{1}, kLoadClientsMax))
        ->capture_default_str();
    load->add_option("--seconds", flags->options.seconds,
                     "How long they move; then they wait for what is missing, and leave")
        ->check(CLI::Range(0.1, 86400.0))
        ->capture_default_str();
    load->add_option("--ramp", flags->options.ramp_seconds,
                     "Seconds over which clients come, one after the other; at most half of "
                     "--seconds")
        ->check(CLI::Range(0.0, 86400.0))
        ->capture_default_str();
    auto* ws =
        load->add_flag("--ws", flags->ws, "Over WebSocket, at /ws of the server's HTTP address");
    load->add_flag("--http", flags->http,
                   "Over HTTP/1.1, a kept connection each: a GET a chunk, by key")
        ->excludes(ws);
    add_what_clients_do(*load, *flags);
    add_door_flags(*load, flags->options.client.token, flags->options.tls);
    load->add_option("--check", flags->options.check_every,
                     "Compare every N-th chunk with one generated here from the server's world "
                     "file; 0: none")
        ->type_name("N")
        ->capture_default_str();
    load->add_option("--decode", flags->options.client.decode_every,
                     "Decode every N-th chunk only, where decoding would take the processor that "
                     "the server needs; the others count when they have come, and --check takes "
                     "its N-th of those that are decoded")
        ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000}))
        ->type_name("N")
        ->capture_default_str();
    load->add_option("--patience", flags->patience_seconds,
                     "A client that wants chunks and hears nothing for so many seconds is hung")
        ->check(CLI::Range(0.1, 3600.0))
        ->capture_default_str();
    load->add_flag("--json", flags->options.json, "Print JSON in place of text");
    load->footer(
        "Latency is from the moment a chunk is wanted to the moment it is decoded. Fairness is\n"
        "Jain's index, and the least over the most, of the chunks that each client got a second\n"
        "from the end of the ramp until its first view was whole. Wasted is what came after it had "
        "left the view.\n"
        "Exit code: 0 all came and was right, 1 something was wrong, refused, hung or cut off,\n"
        "2 wrong use.\n"
        "Examples:\n"
        "  terrane-client load --clients 200 --seconds 30             200 walkers\n"
        "  terrane-client load --clients 50 --move mix --json         for programs\n"
        "  terrane-client load --ws --tls --ca ca.pem --server HOST:8080 --token T\n"
        "  terrane-client load --path tour.txt --radius 8,8,8,8,8     far views along a tour");
    load->callback([flags, &exit_code] { exit_code = run_load_command(*flags); });
}

}  // namespace terrane
