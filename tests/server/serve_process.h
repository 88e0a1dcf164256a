// `terrane serve` as a process of its own, and what tests ask of it.
#pragma once

#include "protocol/wire/messages.h"
#include "server/cli/program.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdint>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

namespace terrane {

inline std::string world_path() {
    return std::string(TERRANE_SOURCE_DIR) + "/generator/worlds/paper-B2.toml";
}

inline int run_serve(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"terrane", "serve"});
    std::vector<char*> argv;
    for (std::string& argument : arguments) {
        argv.push_back(argument.data());
    }
    return run_program(static_cast<int>(argv.size()), argv.data());
}

/// `terrane serve` in a child, listening on a port of the system's choice.
class ServeProcess {
  public:
    explicit ServeProcess(std::vector<std::string> arguments) {
        std::array<int, 2> pipe{};
        EXPECT_EQ(::pipe(pipe.data()), 0);
        child_ = ::fork();
        if (child_ == 0) {
            ::dup2(pipe[1], STDOUT_FILENO);
            ::close(pipe[0]);
            ::close(pipe[1]);
            arguments.insert(arguments.end(), {"--tcp", "127.0.0.1:0", "--http", "127.0.0.1:0"});
            ::_exit(run_serve(std::move(arguments)));
        }
        ::close(pipe[1]);
        std::array<char, 1024> buffer{};
        while (line_.find('\n') == std::string::npos) {
            const ssize_t got = ::read(pipe[0], buffer.data(), buffer.size());
            if (got <= 0) {
                break;
            }
            line_.append(buffer.data(), static_cast<std::size_t>(got));
        }
        ::close(pipe[0]);
    }

    ~ServeProcess() {
        if (child_ > 0) {
            signal(SIGKILL);
            wait();
        }
    }

    ServeProcess(const ServeProcess&) = delete;
    ServeProcess& operator=(const ServeProcess&) = delete;

    /// What it said when it was ready.
    const std::string& line() const { return line_; }

    std::uint16_t port() const { return port_behind("listening on tcp 127.0.0.1:"); }

    std::uint16_t http_port() const { return port_behind("listening on http 127.0.0.1:"); }

    bool is_running() const { return ::waitpid(child_, nullptr, WNOHANG) == 0; }

    /// A number of /proc/PID/status in bytes: "VmRSS" is what it holds now, "VmHWM" the most that
    /// it ever held.
    std::size_t memory_bytes(const std::string& name) const {
        std::ifstream status("/proc/" + std::to_string(child_) + "/status");
        for (std::string line; std::getline(status, line);) {
            if (line.starts_with(name + ":")) {
                return std::stoull(line.substr(name.size() + 1)) * 1024;
            }
        }
        ADD_FAILURE() << "no " << name;
        return 0;
    }

    void signal(int number) const { ::kill(child_, number); }

    /// The wait status.
    int wait() {
        int status = 0;
        ::waitpid(child_, &status, 0);
        child_ = 0;
        return status;
    }

  private:
    std::uint16_t port_behind(const std::string& words) const {
        const std::size_t at = line_.find(words);
        EXPECT_NE(at, std::string::npos) << line_;
        return at == std::string::npos
                   ? std::uint16_t{0}
                   : static_cast<std::uint16_t>(std::stoi(line_.substr(at + words.size())));
    }

    pid_t child_ = 0;
    std::string line_;
};

/// 64 chunks of one row; each id has a row of its own.
inline ChunkRequest row_of(std::uint32_t id) {
    ChunkRequest request;
    request.request_id = id;
    for (std::int32_t x = 0; x < 64; ++x) {
        request.keys.push_back({.lod = 0, .x = x, .y = 0, .z = static_cast<std::int32_t>(id)});
    }
    return request;
}

}  // namespace terrane
