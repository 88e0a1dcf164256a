// terrane serve as a process of its own: what it prints, how it stops, its exit codes.
#include "protocol/wire/messages.h"
#include "server/net/tokens.h"
#include "tests/server/raw_client.h"
#include "tests/server/serve_process.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace terrane {
namespace {

/// A folder that goes away with the test.
struct Folder {
    Folder() {
        std::string name =
            (std::filesystem::temp_directory_path() / "terrane-serve-XXXXXX").string();
        path = ::mkdtemp(name.data());
    }

    ~Folder() { std::filesystem::remove_all(path); }

    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;

    std::filesystem::path path;
};

TEST(Serve, StopsUnderLoadWithAGoodbyeAndEveryAnswer) {
    for (int round = 0; round < 10; ++round) {
        ServeProcess serve({"--world", world_path(), "--store", "memory", "--log-level", "off"});
        std::optional<RawClient> connection(std::in_place, serve.port());
        RawClient& client = *connection;
        ASSERT_TRUE(client.hello());
        client.send(row_of(1));
        client.send(row_of(2));
        std::size_t chunks = 0;
        while (chunks < 70) {  // both requests are read by then
            const auto received = client.next();
            ASSERT_TRUE(received);
            chunks += std::holds_alternative<ChunkAnswer>(received->message) ? 1U : 0U;
        }
        serve.signal(round % 2 == 0 ? SIGTERM : SIGINT);
        bool goodbye = false;
        while (const auto received = client.next()) {
            chunks += std::holds_alternative<ChunkAnswer>(received->message) ? 1U : 0U;
            goodbye = goodbye || std::holds_alternative<Goodbye>(received->message);
        }
        EXPECT_TRUE(goodbye);
        EXPECT_EQ(chunks, 128U);
        if (round >
            0) {  // a client that keeps its end open is waited for two seconds, not for ever
            connection.reset();
        }
        const int status = serve.wait();
        ASSERT_TRUE(WIFEXITED(status));
        EXPECT_EQ(WEXITSTATUS(status), kExitDone);
    }
}

TEST(Serve, ASecondSignalEndsAtOnce) {
    ServeProcess serve({"--world", world_path(), "--store", "memory", "--log-level", "off"});
    RawClient client(serve.port());
    ASSERT_TRUE(client.hello());
    serve.signal(SIGTERM);
    ASSERT_TRUE(client.next_as<Goodbye>());  // it waits for the client to close now
    serve.signal(SIGTERM);
    const int status = serve.wait();
    ASSERT_TRUE(WIFSIGNALED(status));
    EXPECT_EQ(WTERMSIG(status), SIGTERM);
}

TEST(Serve, ReadsItsTokensAgainAtSighup) {
    const Folder folder;
    const std::filesystem::path tokens = folder.path / "tokens.toml";
    const auto add = [&](const std::string& name, const std::string& token) {
        TokenEntry entry;
        entry.name = name;
        entry.hash = sha256_of(token);
        return add_token(tokens, entry).has_value();
    };
    ASSERT_TRUE(add("first", "one"));
    const ServeProcess serve({"--world", world_path(), "--store", "memory", "--log-level", "off",
                              "--tokens", tokens.string(), "--anonymous", "no"});
    const auto lets_in = [&](const std::string& token) {
        RawClient client(serve.port());
        client.send(ClientHello{
            .protocol_version = kProtocolVersion, .client_name = "raw", .token = token});
        const auto answer = client.next();
        return answer && std::holds_alternative<ServerHello>(answer->message);
    };
    EXPECT_TRUE(lets_in("one"));
    EXPECT_FALSE(lets_in("two"));
    ASSERT_TRUE(add("second", "two"));
    EXPECT_FALSE(lets_in("two")) << "not before it is told";
    serve.signal(SIGHUP);
    bool is_in = false;
    for (int attempt = 0; attempt < 1000 && !is_in; ++attempt) {  // a signal has no answer
        is_in = lets_in("two");
    }
    EXPECT_TRUE(is_in);
    EXPECT_TRUE(lets_in("one"));
}

TEST(Serve, SaysWhereItListensAndWhichWorldItIs) {
    const ServeProcess serve({"--world", world_path(), "--store", "memory", "--log-level", "off"});
    EXPECT_NE(serve.line().find("world \"paper-B2\", fingerprint "), std::string::npos);
    EXPECT_EQ(std::count(serve.line().begin(), serve.line().end(), '\n'), 2);
}

TEST(Serve, APortInUseOrAFolderItCanNotHaveIsAFailure) {
    const Folder folder;
    const std::string data = (folder.path / "data").string();
    const ServeProcess serve({"--world", world_path(), "--data", data, "--log-level", "off"});
    const std::string port = std::to_string(serve.port());
    EXPECT_EQ(run_serve({"--world", world_path(), "--store", "memory", "--log-level", "off",
                         "--tcp", "127.0.0.1:" + port}),
              kExitFailed);
    EXPECT_EQ(run_serve({"--world", world_path(), "--data", data, "--log-level", "off", "--tcp",
                         "127.0.0.1:0"}),
              kExitFailed)
        << "the folder is in use";
    EXPECT_EQ(run_serve({"--world", world_path(), "--data", "/proc/terrane", "--log-level", "off",
                         "--tcp", "127.0.0.1:0"}),
              kExitFailed);
}

TEST(Serve, WrongUseIsExitCodeTwo) {
    const std::vector<std::string> good{"--world", world_path(), "--store", "memory"};
    const std::vector<std::vector<std::string>> wrong{
        {"--tcp", "nowhere"},        {"--tcp", "127.0.0.1:65536"},
        {"--workers", "0"},          {"--workers", "257"},
        {"--cache-mib", "0"},        {"--cache-mib", "-1"},
        {"--store", "paper"},        {"--log-format", "xml"},
        {"--log-level", "loud"},     {"--tileset-levels", "4"},
        {"--tileset-levels", "21"},  {"--no-such-flag"},
        {"--world", "no-such.toml"}, {"extra"},
        {"--store", "rocksdb"},
    };
    for (const auto& flags : wrong) {
        auto arguments = flags[0] == "--world" || flags[0] == "--store"
                             ? std::vector<std::string>{"--world", world_path()}
                             : good;
        if (flags[0] == "--world") {
            arguments = {"--store", "memory"};
        }
        arguments.insert(arguments.end(), flags.begin(), flags.end());
        EXPECT_EQ(run_serve(arguments), kExitWrongUse) << flags[0];
    }
    EXPECT_EQ(run_serve({}), kExitWrongUse);
}

}  // namespace
}  // namespace terrane
