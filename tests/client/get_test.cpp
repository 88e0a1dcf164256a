#include "client-sample/cpp/program/get.h"

#include "client-sample/cpp/program/obj.h"
#include "client-sample/cpp/program/program.h"
#include "generator/mesh/draco_codec.h"
#include "generator/volume/chunk_codec.h"
#include "protocol/wire/column_payload.h"
#include "tests/client/scripted_peer.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <fstream>
#include <iterator>

namespace terrane {
namespace {

namespace fs = std::filesystem;

struct Outcome {
    int exit_code = 0;
    std::string out;
    std::string err;

    nlohmann::json json() const { return nlohmann::json::parse(out); }
};

Outcome run(std::vector<std::string> arguments) {
    std::vector<const char*> argv = {"terrane-client"};
    for (const std::string& argument : arguments) {
        argv.push_back(argument.c_str());
    }
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    Outcome outcome;
    outcome.exit_code = run_client_program(static_cast<int>(argv.size()), argv.data());
    outcome.out = testing::internal::GetCapturedStdout();
    outcome.err = testing::internal::GetCapturedStderr();
    return outcome;
}

/// A fresh folder that goes away with the test.
class Get : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = fs::temp_directory_path() /
                  ("terrane_get_" + std::to_string(::getpid()) + "_" +
                   testing::UnitTest::GetInstance()->current_test_info()->name());
        fs::create_directories(folder_);
    }

    void TearDown() override { fs::remove_all(folder_); }

    std::string path(const std::string& name) const { return (folder_ / name).string(); }

    std::size_t file_count() const {
        return static_cast<std::size_t>(
            std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
    }

  private:
    fs::path folder_;
};

Bytes bytes_in(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    EXPECT_TRUE(file) << path;
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    const auto bytes = bytes_of(text);
    return {bytes.begin(), bytes.end()};
}

/// A square of two triangles, 4 voxels wide, at half a voxel above the chunk's floor.
Bytes draco_square() {
    Mesh mesh;
    for (const auto& [x, z] :
         {std::pair(0, 0), std::pair(1024, 0), std::pair(0, 1024), std::pair(1024, 1024)}) {
        mesh.positions256.emplace_back(x, 128, z);
        mesh.normals.emplace_back(0.F, 1.F, 0.F);
        mesh.colors.emplace_back(255, 0, 0);
        mesh.material_ids.push_back(0);
    }
    mesh.indices = {0, 2, 1, 1, 2, 3};
    return encode_draco(mesh, DracoSettings{}).value();
}

Bytes uniform_columns(ChunkPos key) {
    Chunk chunk;
    chunk.position = key;
    chunk.side = 32;
    chunk.height = 32;
    chunk.uniform = true;
    chunk.uniform_content.composition.add(0, 1.0);
    Bytes chunk_bytes;
    encode_chunk(chunk_bytes, chunk);
    return encode_column_payload(chunk_bytes);
}

ChunkAnswer answer_to(const ChunkRequest& request, ChunkPos key, ChunkStatus status,
                      const Bytes& payload) {
    return {.request_id = request.request_id,
            .key = key,
            .format = request.format,
            .status = status,
            .source = ChunkSource::store,
            .etag = hash128(payload),
            .timings = {.queue_us = 1, .generate_us = 2500, .mesh_us = 3, .encode_us = 4},
            .payload_bytes = static_cast<std::uint32_t>(payload.size()),
            .uniform = status == ChunkStatus::uniform
                           ? WireComposition{{.material = 0, .concentration = 1}}
                           : WireComposition{}};
}

/// Answers every key of a session by `payload_of`: no bytes means uniform below y 0 and empty
/// above.
template <typename PayloadOf>
auto serving(PayloadOf payload_of) {
    return [payload_of](PeerSocket& socket) {
        socket.greet();
        while (const auto request = socket.receive_kind<ChunkRequest>()) {
            for (const ChunkPos key : request->keys) {
                const Bytes payload = payload_of(key);
                const auto status = !payload.empty() ? ChunkStatus::full
                                    : key.y < 0      ? ChunkStatus::uniform
                                                     : ChunkStatus::empty;
                socket.send(answer_to(*request, key, status, payload), payload);
            }
        }
    };
}

Bytes square_at_ground(ChunkPos key) {
    return key.y == 0 ? draco_square() : Bytes();
}

TEST_F(Get, WritesExactlyThePayloadAndReportsIt) {
    const ScriptedPeer peer(serving(square_at_ground));
    const auto outcome =
        run({"get", "--at", "0,0,0", "--server", peer.address(), "-o", path("a.draco"), "--json"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    const Bytes payload = draco_square();
    EXPECT_EQ(bytes_in(path("a.draco")), payload);
    const auto chunk = outcome.json().at("chunks").at(0);
    EXPECT_EQ(chunk.at("lod"), 0);
    EXPECT_EQ(chunk.at("status"), "full");
    EXPECT_EQ(chunk.at("source"), "store");
    EXPECT_EQ(chunk.at("bytes"), payload.size());
    EXPECT_EQ(chunk.at("triangles"), 2);
    EXPECT_EQ(chunk.at("hash"), to_hex(hash128(payload)));
    EXPECT_EQ(file_count(), 1U);
}

TEST_F(Get, SeveralChunksGoToAFolderInTheOrderAskedFor) {
    const ScriptedPeer peer(serving(square_at_ground));
    const auto outcome =
        run({"get", "--at", "-1,0,5", "--at=2,-1,-2147483648", "--at", "3,1,2147483647", "--server",
             peer.address(), "--output", path("deep/er"), "--json"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(bytes_in(path("deep/er/0_-1_0_5.draco")), draco_square());
    EXPECT_EQ(bytes_in(path("deep/er/0_2_-1_-2147483648.draco")), Bytes());
    EXPECT_EQ(bytes_in(path("deep/er/0_3_1_2147483647.draco")), Bytes());
    const auto chunks = outcome.json().at("chunks");
    ASSERT_EQ(chunks.size(), 3U);
    EXPECT_EQ(chunks[0].at("x"), -1);
    EXPECT_EQ(chunks[1].at("status"), "uniform");
    EXPECT_EQ(chunks[1].at("composition").at("rock"), 1.0);
    EXPECT_EQ(chunks[1].at("hash"), to_hex(hash128({})));
    EXPECT_EQ(chunks[2].at("status"), "empty");
    EXPECT_EQ(chunks[2].at("triangles"), 0);
}

TEST_F(Get, MoreThan64ChunksTakeSeveralRequests) {
    const ScriptedPeer peer(serving([](ChunkPos) { return Bytes(); }));
    std::vector<std::string> arguments = {"get", "--server", peer.address(), "--json"};
    for (int x = 0; x < 200; ++x) {
        arguments.insert(arguments.end(), {"--at", std::to_string(x) + ",0,0"});
    }
    const auto outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(outcome.json().at("chunks").size(), 200U);
}

TEST_F(Get, NamesBlocksByTheirStyle) {
    const ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        const auto request = socket.receive_kind<ChunkRequest>();
        ASSERT_TRUE(request);
        EXPECT_EQ(request->format, ChunkFormat::draco_blocky);
        const Bytes payload = draco_square();
        socket.send(answer_to(*request, request->keys[0], ChunkStatus::full, payload), payload);
        socket.wait_for_end();
    });
    const auto outcome = run({"get", "--at", "-1,0,5", "--format", "blocky", "--server",
                              peer.address(), "-o", path("blocks/"), "--obj", "--json"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(bytes_in(path("blocks/0_-1_0_5.blocky.draco")), draco_square());
    EXPECT_FALSE(bytes_in(path("blocks/0_-1_0_5.obj")).empty());
    EXPECT_EQ(outcome.json().at("chunks").at(0).at("triangles"), 2);
}

TEST_F(Get, DecodesColumns) {
    const ScriptedPeer peer(serving(uniform_columns));
    const auto outcome = run({"get", "--at", "1,2,3", "--format", "columns", "--server",
                              peer.address(), "-o", path("a.columns"), "--json"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(bytes_in(path("a.columns")), uniform_columns({.lod = 0, .x = 1, .y = 2, .z = 3}));
    EXPECT_EQ(outcome.json().at("chunks").at(0).at("triangles"), 0);
}

TEST_F(Get, ColumnsOfAnotherChunkFail) {
    const ScriptedPeer peer(
        serving([](ChunkPos) { return uniform_columns({.lod = 0, .x = 9, .y = 9, .z = 9}); }));
    const auto outcome =
        run({"get", "--at", "1,2,3", "--format", "columns", "--server", peer.address()});
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_NE(outcome.err.find("another chunk"), std::string::npos) << outcome.err;
}

TEST_F(Get, FailsOnWhatItCannotDecodeAndWritesNoFile) {
    for (const char* format : {"draco", "columns"}) {
        const ScriptedPeer peer(serving([](ChunkPos) { return Bytes(40, std::byte{0x55}); }));
        const auto outcome = run({"get", "--at", "0,0,0", "--format", format, "--server",
                                  peer.address(), "-o", path("bad"), "--json"});
        EXPECT_EQ(outcome.exit_code, 1) << format;
        EXPECT_EQ(outcome.json().at("chunks").size(), 0U);
        EXPECT_EQ(outcome.json().at("failures").at(0).at("code"), "malformed");
        EXPECT_EQ(file_count(), 0U);
    }
}

TEST_F(Get, WritesObjInWorldMetres) {
    auto hello = test_hello();
    hello.voxel_size_m = 0.5;
    const ScriptedPeer peer([&](PeerSocket& socket) {
        socket.greet(hello);
        const auto request = socket.receive_kind<ChunkRequest>();
        ASSERT_TRUE(request);
        const Bytes payload = draco_square();
        socket.send(answer_to(*request, request->keys[0], ChunkStatus::full, payload), payload);
        socket.wait_for_end();
    });
    const auto outcome = run(
        {"get", "--at", "-1,2,1", "--server", peer.address(), "-o", path("hill.draco"), "--obj"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    const Bytes bytes = bytes_in(path("hill.draco.obj"));
    const std::string text(text_of(bytes));
    // Corner (0, 0.5, 0) voxels of chunk (-1, 2, 1): x -32, y 64.5, z 32 voxels of half a metre.
    EXPECT_NE(text.find("v -16.000000 32.250000 16.000000 1.0000 0.0000 0.0000\n"),
              std::string::npos)
        << text;
    EXPECT_NE(text.find("v -14.000000 32.250000 18.000000"), std::string::npos) << text;
    std::size_t faces = 0;
    for (std::size_t at = text.find("\nf "); at != text.npos; at = text.find("\nf ", at + 1)) {
        ++faces;
    }
    EXPECT_EQ(faces, 2U);
}

TEST(Obj, ANormalOfNoLengthIsUpNotNan) {
    Mesh mesh;
    mesh.positions256.resize(1);
    mesh.normals.resize(1);
    mesh.normals[0] = {};
    const std::string text = obj_of(mesh, {.lod = 0, .x = 0, .y = 0, .z = 0}, test_hello());
    EXPECT_NE(text.find("vn 0.0000 1.0000 0.0000\n"), std::string::npos) << text;
}

TEST(Obj, ALineLongerThanItsRoomIsCut) {
    auto hello = test_hello();
    hello.voxel_size_m = 1e300;  // no server's: decoding refuses it
    Mesh mesh;
    mesh.positions256.resize(1);
    mesh.positions256[0] = {256, 256, 256};
    const std::string text = obj_of(mesh, {.lod = 0, .x = 1, .y = 1, .z = 1}, hello);
    const std::size_t line = text.find("\nv ") + 1;
    EXPECT_EQ(text.find('\n', line) - line, 255U);
}

TEST_F(Get, PrintsAnAlignedTable) {
    const ScriptedPeer peer(serving(square_at_ground));
    const auto outcome =
        run({"get", "--at", "0,0,0", "--at", "-100,-1,0", "--server", peer.address()});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    std::istringstream lines(outcome.out);
    std::string header;
    std::string first;
    std::string second;
    std::getline(lines, header);
    std::getline(lines, first);
    std::getline(lines, second);
    EXPECT_EQ(header.find("status"), first.find("full"));
    EXPECT_EQ(header.find("status"), second.find("uniform"));
    EXPECT_EQ(header.find("generate ms") + 11, first.find("2.500") + 5);
    EXPECT_EQ(header.size(), first.size());
}

TEST_F(Get, ARefusedChunkFailsAndTheOthersStillCome) {
    const ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        const auto request = socket.receive_kind<ChunkRequest>();
        ASSERT_TRUE(request);
        socket.send(Failure{.request_id = request->request_id,
                            .error = {.code = ErrorCode::unsupported, .message = "no level 9"},
                            .retry_after_ms = 0,
                            .key = request->keys[0]});
        socket.send(answer_to(*request, request->keys[1], ChunkStatus::empty, {}));
        socket.wait_for_end();
    });
    const auto outcome = run({"get", "--at", "0,0,0", "--at", "1,0,0", "--lod", "9", "--server",
                              peer.address(), "--json"});
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_NE(outcome.err.find("no level 9"), std::string::npos);
    EXPECT_EQ(outcome.json().at("chunks").size(), 1U);
    EXPECT_EQ(outcome.json().at("failures").size(), 1U);
}

TEST_F(Get, ASilentServerRunsIntoTheTimeout) {
    const ScriptedPeer peer([](PeerSocket& socket) {
        socket.greet();
        socket.wait_for_end();
    });
    const auto outcome =
        run({"get", "--at", "0,0,0", "--server", peer.address(), "--timeout", "0.1"});
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_NE(outcome.err.find("did not come in time"), std::string::npos) << outcome.err;
}

TEST_F(Get, AnUnwritableFileFails) {
    const ScriptedPeer peer(serving(square_at_ground));
    const auto outcome = run(
        {"get", "--at", "0,0,0", "--server", peer.address(), "-o", path("no/such/folder.draco")});
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_NE(outcome.err.find("folder.draco"), std::string::npos);
}

TEST_F(Get, WrongUseIsExitCode2) {
    const std::vector<std::vector<std::string>> wrong = {
        {"get"},
        {"get", "--at", "1,2"},
        {"get", "--at", "1,2,3,4"},
        {"get", "--at", "a,0,0"},
        {"get", "--at", "1, 2,3"},
        {"get", "--at", "2147483648,0,0"},
        {"get", "--at", "0,0,-2147483649"},
        {"get", "--at", "0,0,0", "--format", "glb"},
        {"get", "--at", "0,0,0", "--server", "localhost:0"},
        {"get", "--at", "0,0,0", "--server", "localhost:65536"},
        {"get", "--at", "0,0,0", "--server", ":7777"},
        {"get", "--at", "0,0,0", "--timeout", "0"},
        {"get", "--at", "0,0,0", "--timeout", "nan"},
        {"get", "--at", "0,0,0", "--obj", "--format", "columns"},
        {"get", "--at", "0,0,0", "--lod", "-1"},
        {"get", "--at", "0,0,0", "--lod", "18"},
        {"get", "--at", "0,1,0", "--lod", "1"},
        {"get", "--at", "0,0,0", "--nonsense"},
        {"fetch"},
        {},
    };
    for (const auto& arguments : wrong) {
        const auto outcome = run(arguments);
        EXPECT_EQ(outcome.exit_code, 2) << testing::PrintToString(arguments);
        EXPECT_FALSE(outcome.err.empty() && outcome.out.empty());
    }
}

TEST_F(Get, HelpTeachesWithExamples) {
    const auto outcome = run({"get", "--help"});
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_NE(outcome.out.find("terrane-client get --at -1,2,0"), std::string::npos);
    EXPECT_NE(outcome.out.find("0..17"), std::string::npos);
}

TEST(GetFlags, AddressesHaveAHostAndMaybeAPort) {
    EXPECT_EQ(parse_address("localhost:1").value(), (Address{.host = "localhost", .port = 1}));
    EXPECT_EQ(parse_address("localhost").value(),
              (Address{.host = "localhost", .port = kDefaultPort}));
    EXPECT_EQ(parse_address("[::1]:80").value(), (Address{.host = "::1", .port = 80}));
    EXPECT_EQ(parse_address("[::1]").value(), (Address{.host = "::1", .port = kDefaultPort}));
    for (const char* text : {"", ":", "a:", "a:x", "a:-1", "a:1x", "[::1]80", "[]:80"}) {
        EXPECT_FALSE(parse_address(text)) << text;
    }
}

TEST(GetFlags, ChunksAreThreeInt32) {
    EXPECT_EQ(parse_chunk("-2147483648,0,2147483647", 0).value(),
              (ChunkPos{.lod = 0, .x = -2147483647 - 1, .y = 0, .z = 2147483647}));
    EXPECT_EQ(parse_chunk("1,2,99999999999", 0).error().code, ErrorCode::out_of_range);
    EXPECT_EQ(parse_chunk("1,,2", 0).error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(parse_chunk("", 0).error().code, ErrorCode::invalid_argument);
}

}  // namespace
}  // namespace terrane
